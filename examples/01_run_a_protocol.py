"""From a protocol to the error of the elbow's flexion, stage by stage, as in a notebook."""

from testbench import estimate, evaluate, execute, plan

the_plan = plan("quick")  # checked and timed; nothing has moved
session = execute(the_plan, logs="logs", seed=1)
estimated = estimate(session)
evaluation = evaluate(session, estimated)
estimated.save(session.path)  # stages keep nothing by themselves
evaluation.save(session.path)

print(f"{the_plan.duration:.1f} s on {the_plan.robot.name}, recorded in {session.path}")
for metric in evaluation.metrics:
    if metric.name == "elbow.flexion_rmse_deg" and metric.sequence == "ZXZ":
        print(f"{metric.filter:8} {metric.section:8} {metric.value:.3f} {metric.unit}")
print(f"outcome: {evaluation.outcome}")

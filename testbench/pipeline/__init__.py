"""Where the stages meet: what is asked of the bench comes in as a record, and goes through them.

- `request`: what is asked; `watcher`: who looks on, and what a person allows.
- `run`: carry out a request for a run; with `prepared`, `arm`, `own_kinematics`, `approval`,
  `resume`, `kept_analysis`.
- `analyse`: estimate, evaluate and report a recording; with `loaded_analysis`, `kept_estimate`,
  `repeats`, `summaries`; `gait`: reckon a walk; `audit`: sampling and axes of its sensors.
- `certificate`: issue a certificate of it.
- `compare`: two sides of sessions, which `sides` finds.
- `show`: look at a recording; `exports`: write it for other programs.
- `follow`: look at one while another process makes it, with `live_session`, `live_sensor`,
  `live_words`; `beside`: start who does.
- `calibrate`, `noise`, `noise_preset`, `tune`, `parameter_space`: what sensors and filters are
  found to be; `design`: poses and turns that would tell it best.
- `record`, `bring_in`, `simulate`: other ways to a recording; `body_request`: the joints asked
  for with it; `examples`: recordings to try the bench with.

Modules are imported one by one: who evaluates a session need not load what drives an arm.
"""

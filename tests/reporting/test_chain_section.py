import numpy as np

from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import ChainRow, Evaluation
from testbench.reporting.page.page import Figures, Sentence
from testbench.reporting.page.tables import Table
from testbench.reporting.sections.chain import MOST_PANELS, chain_section

JOINTS = [f"joint_{i}" for i in range(8)]
TIME = np.arange(100, dtype=np.int64) * 10_000_000


def chain(state: str) -> ChainEstimate:
    mean = np.zeros((100, 3, len(JOINTS)))
    return ChainEstimate(
        section="walk",
        state=state,
        sensors=["a", "b"],
        joints=JOINTS,
        facts={"normalised_innovation_squared": 1.0},
        host_time_ns=TIME,
        mean=mean,
        sd=mean + 0.1,
    )


def row(state: str, joint: str, rmse: float) -> ChainRow:
    numbers = [0.1, 0.1, 0.1, rmse, 0.1, 0.0, 0.3, 0.0, None, 0.99, 1.0, 10.0, 0.1, 1.0, 95.0]
    return ChainRow("walk", state, joint, 100, *numbers)


def made(states: list[str]) -> tuple[Estimate, Evaluation]:
    rows = [
        row(state, joint, 0.1 + i + (state == "kinematic"))
        for state in states
        for i, joint in enumerate(JOINTS)
    ]
    signals = {"host_time_ns": TIME, "judged": np.ones(100, dtype=bool)}
    signals |= {f"{joint}_error_rad": np.zeros(100) for joint in JOINTS}
    series = {f"chain_walk_{state}": signals for state in states}
    evaluation = Evaluation(session="s", series=series, chain=rows)
    return Estimate("s", "", {}, {}, chain=[chain(state) for state in states]), evaluation


def test_a_session_without_a_chain_has_no_such_section():
    assert chain_section(Estimate("s", "", {}, {}), None, []) is None


def test_every_joint_and_state_has_a_row_and_the_lower_error_is_marked():
    section = chain_section(*made(["kinematic", "fourier"]), [])
    errors, facts = [block for block in section.blocks if isinstance(block, Table)]
    assert len(facts.rows) == 2
    assert [(line.cells[0].text, line.cells[2].text) for line in errors.rows[:2]] == [
        ("joint_0", "kinematic"),
        ("joint_0", "fourier"),
    ]
    marked = [
        line.cells[2].text
        for line in errors.rows
        if any("best" in cell.kind for cell in line.cells)
    ]
    assert marked == ["fourier"] * len(JOINTS)


def test_of_many_joints_those_with_the_largest_errors_are_drawn():
    section = chain_section(*made(["fourier"]), [])
    (drawn,) = [block for block in section.blocks if isinstance(block, Figures)]
    (figure,) = drawn.figures.values()
    titles = [
        axis["title"]["text"] for name, axis in figure["layout"].items() if name.startswith("yaxis")
    ]
    assert titles == [f"joint_{i} [deg]" for i in range(7, 7 - MOST_PANELS, -1)]


def test_a_chain_that_was_not_judged_says_so():
    estimated, _ = made(["fourier"])
    section = chain_section(estimated, None, [])
    assert any(isinstance(block, Sentence) for block in section.blocks)

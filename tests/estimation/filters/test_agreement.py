"""Our kernels against independent implementations: packages, or the equations written down once
more with whole matrices.
"""

from __future__ import annotations

from dataclasses import replace

import ahrs
import imufusion
import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from vqf import PyVQF

from testbench.estimation.filters import UniformSamples, get_filter
from testbench.estimation.filters.maths import with_north
from testbench.model import rotation
from testbench.model.earths import to_earth_frame
from tests.estimation.filters.motions import degrees_between, wander

pytestmark = pytest.mark.slow

SAME = 1e-5
"""Degrees that two implementations in double precision may differ by after 2000 samples."""
SAMPLES, _ = wander()
DT = SAMPLES.interval


def misfit(q, a, m, b):
    """f of eqs 25 and 29 of the report of 2010."""
    w, x, y, z = q
    rows = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.concatenate([rows @ [0, 0, 1] - a, rows @ b - m])


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def turn(q, vector):
    """q times the rotation by a vector of the sensor."""
    return (Rotation.from_quat(q, scalar_first=True) * Rotation.from_rotvec(vector)).as_quat(
        scalar_first=True
    )


def matrix(q):
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def unit(v):
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("beta", [0.001, 0.033, 0.5])
def test_madgwick_is_that_of_the_ahrs_package(beta):
    six, nine = (
        get_filter("madgwick_imu", {"beta": beta}).run(SAMPLES),
        get_filter("madgwick_marg", {"beta": beta}).run(SAMPLES),
    )
    theirs = ahrs.filters.Madgwick(
        gyr=SAMPLES.gyr, acc=SAMPLES.acc, frequency=1 / DT, gain_imu=beta, q0=six[0]
    ).Q
    assert degrees_between(six, theirs) < SAME
    start = to_earth_frame(nine[0], "NWU")  # theirs has north along x
    theirs = ahrs.filters.Madgwick(
        gyr=SAMPLES.gyr,
        acc=SAMPLES.acc,
        mag=SAMPLES.mag,
        frequency=1 / DT,
        gain_marg=beta,
        q0=start,
    ).Q
    assert degrees_between(to_earth_frame(nine, "NWU"), theirs) < SAME


@pytest.mark.parametrize(("kp", "ki"), [(1.0, 0.3), (0.74, 0.0012)])
def test_mahony_is_that_of_the_ahrs_package(kp, ki):
    for name, mag in (("mahony_imu", None), ("mahony_marg", SAMPLES.mag)):
        ours = get_filter(name, {"kp": kp, "ki": ki}).run(SAMPLES)
        theirs = ahrs.filters.Mahony(
            gyr=SAMPLES.gyr,
            acc=SAMPLES.acc,
            mag=mag,
            frequency=1 / DT,
            k_P=kp,
            k_I=ki,
            q0=ours[0],
            b0=np.zeros(3),
        ).Q
        assert degrees_between(ours, theirs) < SAME


def test_the_quaternion_ekf_is_that_of_the_ahrs_package():
    # its "NED" has gravity's reading along +z, as an accelerometer has it with z up; its "ENU" has
    # it the other way round
    for name, mag in (("ekf_imu", None), ("ekf", SAMPLES.mag)):
        ours = get_filter(name, {"gyr_sd_rad_s": 0.2, "acc_sd": 0.4}).run(SAMPLES)
        field = unit(rotation.rotate(ours[0], SAMPLES.mag[0]))
        theirs = ahrs.filters.EKF(
            gyr=SAMPLES.gyr,
            acc=SAMPLES.acc,
            mag=mag,
            frequency=1 / DT,
            frame="NED",
            q0=ours[0],
            magnetic_ref=field,
            noises=[0.2**2, 0.4**2, 0.8**2],
        ).Q
        assert degrees_between(ours, theirs) < SAME


def test_the_enu_frame_of_that_packages_ekf_is_upside_down():
    samples, true = wander(10)
    wrong = ahrs.filters.EKF(
        gyr=samples.gyr, acc=samples.acc, frequency=1 / DT, frame="ENU", q0=true[0]
    ).Q
    up = rotation.rotate(wrong[-1], samples.acc[-1])
    assert up[2] < 0  # it pulls the force downwards from a start that is right
    ours = get_filter("ekf_imu").run(samples)
    assert rotation.rotate(ours[-1], samples.acc[-1])[2] == pytest.approx(9.8, abs=0.2)


def test_ecompass_triad_and_quest_are_those_of_scipy_and_the_ahrs_package():
    acc, mag = SAMPLES.acc[:200], SAMPLES.mag[:200]
    compass, triad = (get_filter(name).run(SAMPLES)[:200] for name in ("ecompass", "triad"))
    field_first = get_filter("triad", {"field_first": 1}).run(SAMPLES)[:200]
    quest = get_filter("quest", {"mag_weight": 0.3}).run(SAMPLES)[:200]
    dip = np.arcsin(-unit(acc[0]) @ unit(mag[0]))
    field = np.array([0.0, np.cos(dip), -np.sin(dip)])
    for i in range(200):
        theirs = ahrs.common.orientation.ecompass(
            acc[i], mag[i], frame="ENU", representation="rotmat"
        )
        np.testing.assert_allclose(matrix(compass[i]), theirs, atol=1e-9)
        exact = Rotation.align_vectors([[0, 0, 1], field], [acc[i], mag[i]], weights=[np.inf, 1])[
            0
        ].as_matrix()
        np.testing.assert_allclose(matrix(triad[i]), exact, atol=1e-6)
        exact = Rotation.align_vectors([field, [0, 0, 1]], [mag[i], acc[i]], weights=[np.inf, 1])[
            0
        ].as_matrix()
        np.testing.assert_allclose(matrix(field_first[i]), exact, atol=1e-6)
        best = Rotation.align_vectors(
            [[0, 0, 1], field], [unit(acc[i]), unit(mag[i])], weights=[0.7, 0.3]
        )[0].as_matrix()
        np.testing.assert_allclose(matrix(quest[i]), best, atol=1e-6)
    theirs = ahrs.filters.Davenport(
        acc=acc, mag=mag, weights=np.array([0.7, 0.3]), magnetic_dip=np.degrees(dip)
    )
    assert theirs.Q.shape == (200, 4)


def test_the_start_with_a_magnetometer_is_the_ecompass_in_every_branch_of_the_conversion():
    rng = np.random.default_rng(0)
    for true in Rotation.random(200, rng=rng):
        up, north = true.inv().apply([[0, 0, 1], [0, 0.5, -0.8]])
        *q, known = with_north(*up, *north)
        assert known
        np.testing.assert_allclose(matrix(np.array(q)), true.as_matrix(), atol=1e-12)
    assert (
        with_north(0.0, 0.0, 1.0, 0.0, 0.0, -1.0)[4] is False
        or not with_north(0.0, 0.0, 1.0, 0.0, 0.0, -1.0)[4]
    )


def test_the_gyroscope_alone_is_the_product_of_its_turns():
    q = Rotation.from_quat(get_filter("tilt").run(SAMPLES.piece(slice(0, 1)))[0], scalar_first=True)
    expected = [q]
    for rate in SAMPLES.gyr[1:]:
        expected.append(expected[-1] * Rotation.from_rotvec(rate * DT))
    assert (
        degrees_between(
            get_filter("gyro").run(SAMPLES),
            Rotation.concatenate(expected).as_quat(scalar_first=True),
        )
        < SAME
    )


def test_madgwicks_bias_state_is_that_of_the_report():
    """Equations 42 to 49 of the 2010 report; the gradient by the complex step instead of the
    printed Jacobian.
    """
    beta, zeta = 0.05, 0.02

    ours, state = get_filter("madgwick_marg", {"beta": beta, "zeta": zeta}).advance(SAMPLES)
    q = to_earth_frame(ours[0], "NWU")  # the report has north along x
    bias, expected = np.zeros(3), [q]
    for gyr, acc, mag in zip(SAMPLES.gyr[1:], SAMPLES.acc[1:], SAMPLES.mag[1:], strict=True):
        a, m = unit(acc), unit(mag)
        h = matrix(q) @ m
        b = np.array([np.hypot(h[0], h[1]), 0, h[2]])
        f = misfit(q, a, m, b)
        jacobian = np.array([misfit(q + 1e-20j * e, a, m, b).imag / 1e-20 for e in np.eye(4)])
        step = unit(jacobian @ f)
        bias = bias + zeta * DT * 2 * rotation.multiply(rotation.conjugate(q), step)[1:]
        change = 0.5 * rotation.multiply(q, np.r_[0, gyr - bias]) - beta * step
        q = unit(q + change * DT)
        expected.append(q)
    assert degrees_between(to_earth_frame(ours, "NWU"), np.array(expected)) < SAME
    np.testing.assert_allclose(state["gyr_bias_rad_s"], bias, atol=1e-9)


@pytest.mark.parametrize(("beta", "zeta", "rate"), [(0.35, 0.07, 60.0), (0.03, 0.9, 100.0)])
def test_the_upstream_zeta_only_adds_the_interval_times_zeta_to_beta(beta, zeta, rate):
    samples, _ = wander(20, rate)
    printed = get_filter("madgwick_zeta_upstream", {"beta": beta, "zeta": zeta}).run(samples)
    plain = get_filter("madgwick_marg", {"beta": beta + zeta / rate}).run(samples)
    assert degrees_between(printed, plain) < 1e-6


def test_the_zeta_of_the_text_adds_the_size_of_the_gradient_as_well():
    """One step from each state against madgwick_marg with beta + T zeta |s|, the gradient s of eqs
    28 to 30 by complex differences.
    """
    samples, _ = wander(3)
    kind = get_filter("madgwick_zeta_as_printed", {"beta": 0.2, "zeta": 5.0})
    _, state = kind.advance(samples.piece(slice(0, 1)))
    sizes = []
    for i in range(1, len(samples)):
        now = samples.piece(slice(i, i + 1))
        q = to_earth_frame(np.array(state["q"]), "NWU")
        a, m = unit(samples.acc[i]), unit(samples.mag[i])
        h = matrix(q) @ m
        b = np.array([np.hypot(h[0], h[1]), 0.0, h[2]])
        f = misfit(q, a, m, b)
        jacobian = np.array([misfit(q + 1e-20j * e, a, m, b).imag / 1e-20 for e in np.eye(4)])
        sizes.append(np.linalg.norm(jacobian @ f))
        other = get_filter("madgwick_marg", {"beta": 0.2 + DT * 5.0 * sizes[-1]})
        expected, _ = other.advance(now, {**state, "filter": "madgwick_marg"})
        ours, state = kind.advance(now, state)
        assert degrees_between(ours, expected) < 1e-6
    assert np.ptp(sizes) > 0.01  # they differ from sample to sample


def test_the_adaptive_gain_follows_the_gyroscope_where_the_force_is_not_gravity():
    samples, _ = wander(5)
    plain = get_filter("madgwick_marg", {"beta": 0.1}).run(samples)
    at_rest = replace(samples, acc=9.80665 * samples.acc / length(samples.acc))
    adaptive = get_filter("madgwick_adaptive", {"beta": 0.1})
    same = get_filter("madgwick_marg", {"beta": 0.1}).run(at_rest)
    assert degrees_between(adaptive.run(at_rest), same) < 1e-9
    shaken = replace(at_rest, acc=1.3 * at_rest.acc)
    none = get_filter("madgwick_marg", {"beta": 0.0}).run(shaken)
    assert degrees_between(adaptive.run(shaken), none) < 1e-9
    half = replace(at_rest, acc=1.15 * at_rest.acc)  # half-way between both thresholds
    middle = get_filter("madgwick_marg", {"beta": 0.05}).run(half)
    assert degrees_between(adaptive.run(half), middle) < 1e-6
    assert degrees_between(plain, none) > 0.01


def length(vectors):
    return np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("name", ["complementary", "complementary_marg"])
def test_the_complementary_filter_turns_by_part_of_the_angle(name):
    ours = get_filter(name).run(SAMPLES)
    q, expected = Rotation.from_quat(ours[0], scalar_first=True), [ours[0]]
    for gyr, acc, mag in zip(SAMPLES.gyr[1:], SAMPLES.acc[1:], SAMPLES.mag[1:], strict=True):
        q = q * Rotation.from_rotvec(gyr * DT)
        up = unit(q.apply(acc))
        axis = np.cross(up, [0, 0, 1])
        angle = np.arctan2(np.linalg.norm(axis), up[2])
        q = Rotation.from_rotvec((1 - np.exp(-DT / 3.0)) * angle * unit(axis)) * q
        if name == "complementary_marg":
            field = q.apply(mag)
            q = (
                Rotation.from_rotvec(
                    [0, 0, (1 - np.exp(-DT / 9.0)) * np.arctan2(field[0], field[1])]
                )
                * q
            )
        expected.append(q.as_quat(scalar_first=True))
    assert degrees_between(ours, np.array(expected)) < SAME


@pytest.mark.parametrize("name", ["mekf_imu", "mekf"])
def test_the_mekf_is_its_matrix_equations(name):
    """Whole matrices, all measurements at once; the covariance turns as the sensor does, and with
    each correction, so that it keeps its axes in the earth.
    """
    kind = get_filter(name)
    ours, state = kind.advance(SAMPLES)
    p, use_mag = kind.parameters, name == "mekf"
    q, bias, expected = ours[0], np.zeros(3), [ours[0]]
    field = unit(matrix(q) @ SAMPLES.mag[0])
    inclining = (p["acc_sd_m_s2"] / 9.80665) ** 2
    in_earth = np.diag([inclining, inclining, p["mag_sd"] ** 2 if use_mag else inclining])
    R = matrix(q)
    cov = np.block(
        [
            [R.T @ in_earth @ R, np.zeros((3, 3))],
            [np.zeros((3, 3)), p["bias_sd_rad_s"] ** 2 * np.eye(3)],
        ]
    )
    v, u = p["gyr_noise_rad_s_sqrthz"] ** 2, p["bias_walk_rad_s2_sqrthz"] ** 2
    eye = np.eye(3)
    noise = np.block(
        [
            [(v * DT + u * DT**3 / 3) * eye, -u * DT**2 / 2 * eye],
            [-u * DT**2 / 2 * eye, u * DT * eye],
        ]
    )
    for gyr, acc, mag in zip(SAMPLES.gyr[1:], SAMPLES.acc[1:], SAMPLES.mag[1:], strict=True):
        step = (gyr - bias) * DT
        q = turn(q, step)
        turned = Rotation.from_rotvec(-step).as_matrix()
        f = np.block([[turned, -DT * (eye - skew(step) / 2)], [np.zeros((3, 3)), eye]])
        cov = f @ cov @ f.T + noise
        up = matrix(q).T @ [0, 0, 9.80665]
        h, z, r = np.hstack([skew(up), np.zeros((3, 3))]), acc - up, [p["acc_sd_m_s2"] ** 2] * 3
        if use_mag:
            seen = matrix(q).T @ field
            h = np.vstack([h, np.hstack([skew(seen), np.zeros((3, 3))])])
            z, r = np.r_[z, unit(mag) - seen], r + [p["mag_sd"] ** 2] * 3
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + np.diag(r))
        e = gain @ z
        cov = (np.eye(6) - gain @ h) @ cov
        kept = np.eye(6)
        kept[:3, :3] = Rotation.from_rotvec(-e[:3]).as_matrix()
        cov = kept @ cov @ kept.T
        q, bias = turn(q, e[:3]), bias + e[3:]
        expected.append(q)
    assert degrees_between(ours, np.array(expected)) < SAME
    np.testing.assert_allclose(state["gyr_bias_rad_s"], bias, atol=1e-8)


@pytest.mark.parametrize("name", ["imufilter", "ahrsfilter"])
def test_the_error_state_filter_is_its_matrix_equations(name):
    """The published block matrices as they stand, with P+ in full; only its diagonal goes on."""
    kind = get_filter(name)
    ours, state = kind.advance(SAMPLES)
    p, nine = kind.parameters, name == "ahrsfilter"
    size = 12 if nine else 9
    lam, eta, beta, xi, nu = (p[k] for k in list(p)[:5])
    q, offset, linear, expected = ours[0], np.zeros(3), np.zeros(3), [ours[0]]
    field = matrix(q) @ SAMPLES.mag[0]
    field = np.array([0.0, field[1], field[2]])
    eye = np.eye(3)
    cov = np.diag(np.repeat([6.092348396e-6, 7.6154354947e-5, 9.62361e-3, 0.6], 3)[:size])
    k, drops = DT, 0
    for gyr, acc, mag in zip(SAMPLES.gyr[1:], SAMPLES.acc[1:], SAMPLES.mag[1:], strict=True):
        q = turn(q, (gyr - offset) * k)
        up = matrix(q).T @ [0, 0, 9.80665]
        linear = nu * linear
        z = up - (acc - linear)
        h = np.hstack([skew(up), -k * skew(up), eye, np.zeros((3, 3))])[:, :size]
        r = np.full(3, lam + xi + k * k * (beta + eta))
        full = True
        if nine:
            seen = matrix(q).T @ field
            h6 = np.vstack([h, np.hstack([skew(seen), -k * skew(seen), np.zeros((3, 3)), -eye])])
            r6 = np.r_[
                r,
                np.full(3, p["mag_var_uT2"] + p["mag_disturbance_var_uT2"] + k * k * (beta + eta)),
            ]
            z6 = np.r_[z, seen - mag]
            gain = cov @ h6.T @ np.linalg.inv(h6 @ cov @ h6.T + np.diag(r6))
            full = np.sum((gain @ z6)[9:] ** 2) <= 4 * field @ field
            drops += not full
            if full:
                h, r, z = h6, r6, z6
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + np.diag(r))
        x = gain @ z
        after = np.diag(cov - gain @ h @ cov)
        q, offset, linear = turn(q, -x[:3]), offset - x[3:6], linear - x[6:9]
        if nine and full:
            new = field + matrix(q) @ x[9:]
            field = unit(np.array([0, new[1], new[2]])) * np.linalg.norm(field)
        drift = np.diag(after[3:6] + beta)
        top = np.block(
            [[np.diag(after[:3]) + k * k * (drift + eta * eye), -k * drift], [-k * drift, drift]]
        )
        blocks = [top, np.diag(nu**2 * after[6:9] + xi)]
        if nine:
            blocks.append(
                np.diag(p["mag_disturbance_decay"] ** 2 * after[9:] + p["mag_disturbance_var_uT2"])
            )
        cov = block_diag(*blocks)
        expected.append(q)
    assert drops == 0
    assert degrees_between(ours, np.array(expected)) < SAME
    np.testing.assert_allclose(state["gyr_bias_rad_s"], offset, atol=1e-9)


@pytest.mark.parametrize("simple", [False, True])
def test_the_corrected_euler_filters_are_the_general_equations_with_numerical_derivatives(simple):
    kind = get_filter("euler_ekf_simple" if simple else "euler_ekf")
    samples, _ = wander(8)
    ours = kind.run(samples)
    p = kind.parameters

    def predict(x, g):
        roll, pitch, _ = x
        if simple:
            return x + DT * g
        rates = np.array(
            [
                [1, np.sin(roll) * np.tan(pitch), np.cos(roll) * np.tan(pitch)],
                [0, np.cos(roll), -np.sin(roll)],
                [0, np.sin(roll) / np.cos(pitch), np.cos(roll) / np.cos(pitch)],
            ]
        )
        return x + DT * rates @ g

    def observed(a):
        return np.array([np.arctan2(a[1], a[2]), np.arctan2(-a[0], np.hypot(a[1], a[2]))])

    x = np.r_[observed(samples.acc[0]), 0.0]
    r = np.diag([p["roll_sd_rad"] ** 2, p["pitch_sd_rad"] ** 2])
    cov, h = block_diag(r, 0.0), np.eye(3)[:2]
    expected = [x]
    for g, a in zip(samples.gyr[1:], samples.acc[1:], strict=True):
        f = np.array([(predict(x + d, g) - predict(x - d, g)) / 2e-6 for d in 1e-6 * np.eye(3)]).T
        x, cov = predict(x, g), f @ cov @ f.T + p["process_rad_sqrts"] ** 2 * DT * np.eye(3)
        if abs(np.linalg.norm(a) - 9.80665) < p["acc_gate_m_s2"]:
            s = h @ cov @ h.T + r
            gain = cov @ h.T @ np.linalg.inv(s)
            v = (observed(a) - x[:2] + np.pi) % (2 * np.pi) - np.pi
            x, cov = x + gain @ v, cov - gain @ s @ gain.T
        expected.append(x)
    theirs = Rotation.from_euler("ZYX", np.array(expected)[:, ::-1]).as_quat(scalar_first=True)
    assert degrees_between(ours, theirs) < 1e-4


@pytest.mark.parametrize("text", [False, True])
def test_the_euler_filters_of_text_and_program_are_their_transcriptions(text):
    """Transcribed with the program's axes (y and z reversed, force negated), whose earth has z
    down. The text has cos(pitch) in eq. 4.4, begins with eqs 2.17 and 2.18, gates at 1 m/s^2 and
    propagates P always.
    """
    samples, _ = wander(5)
    ours = get_filter("euler_ekf_as_printed" if text else "euler_ekf_listing").run(samples)
    gate = 1.0 if text else 0.1
    to_listing = np.array([1.0, -1.0, -1.0])
    gyr, acc = samples.gyr * to_listing, -samples.acc * to_listing
    x, q = np.zeros(3), 1.56e-4**2 * np.eye(3)
    if text:
        ax, ay, az = acc[0]
        x = np.array([np.arctan(ay / az), np.arctan(-ax / np.sqrt(ay**2 + az**2)), 0.0])
    cov, r, h = q.copy(), 0.0014**2 * np.eye(2), np.eye(3)[:2]
    expected = [x]
    for (gx, gy, gz), (ax, ay, az) in zip(gyr[1:], acc[1:], strict=True):
        roll, pitch, yaw = x
        sr, cr, tp, sec = np.sin(roll), np.cos(roll), np.tan(pitch), 1 / np.cos(pitch)
        x = np.array(
            [
                roll + DT * (gx + gy * sr * tp + gz * (np.cos(pitch) if text else cr) * tp),
                pitch + DT * (gy * cr - gz * sr),
                yaw + DT * (gy * sr + gz * cr) * sec,
            ]
        )
        a = np.eye(3) + DT * np.array(
            [
                [gy * cr * tp - gz * sr * tp, gy * sr * sec**2 + gz * cr * sec**2, 0],
                [-gy * sr - gz * cr, 0, 0],
                [gy * cr * sec - gz * sr * sec, gy * sr * sec * tp + gz * cr * sec * tp, 0],
            ]
        )
        x = (x + np.pi) % (2 * np.pi) - np.pi
        if text:
            cov = a @ cov @ a.T + q
        if abs(np.sqrt(ax**2 + ay**2 + az**2) - 9.80665) < gate:
            z = np.array([np.arctan(ay / az), np.arctan(-ax / np.sqrt(ay**2 + az**2))])
            cov = cov if text else a @ cov @ a.T + q
            s = h @ cov @ h.T + r
            gain = cov @ h.T @ np.linalg.inv(s)
            x, cov = x + gain @ (z - x[:2]), cov - gain @ s @ gain.T
        expected.append(x)
    down = Rotation.from_euler("ZYX", np.array(expected)[:, ::-1])
    flip = Rotation.from_euler("x", np.pi)
    assert degrees_between(ours, (flip * down * flip.inv()).as_quat(scalar_first=True)) < 1e-4


@pytest.mark.parametrize(
    "parameters", [{}, {"tau_acc_s": 1.0, "rest_bias": 0, "bias_motion_sd_deg_s": 0.05}]
)
def test_vqf_is_its_authors_form_in_python(parameters):
    samples = SAMPLES.piece(slice(0, 1500))
    names = {
        "tau_acc_s": "tauAcc",
        "rest_bias": "restBiasEstEnabled",
        "bias_motion_sd_deg_s": "biasSigmaMotion",
    }
    given = {names[k]: bool(v) if k == "rest_bias" else v for k, v in parameters.items()}
    theirs = PyVQF(DT, **given).updateBatch(samples.gyr, samples.acc, samples.mag)
    assert degrees_between(get_filter("vqf_9d", parameters).run(samples), theirs["quat9D"]) < SAME
    assert degrees_between(get_filter("vqf_6d", parameters).run(samples), theirs["quat6D"]) < SAME


def imufusion_loop(
    samples: UniformSamples, parameters: dict[str, float], magnetometer: bool
) -> np.ndarray:
    """What its authors' package makes of the samples after the first, started where ours starts."""
    theirs, settings = imufusion.Ahrs(), imufusion.AhrsSettings()
    settings.convention, settings.sample_rate = imufusion.CONVENTION_ENU, 1 / samples.interval
    settings.gain = parameters.get("gain", 0.5)
    settings.acceleration_rejection = parameters.get("acceleration_rejection_deg", 10.0)
    settings.magnetic_rejection = parameters.get("magnetic_rejection_deg", 10.0)
    settings.rejection_timeout = parameters.get("rejection_timeout_s", 5.0)
    settings.gyroscope_range = parameters.get("gyroscope_range_deg_s", 0.0)
    theirs.set_settings(settings)
    theirs.set_quaternion(
        get_filter("ecompass" if magnetometer else "tilt").run(samples.piece(slice(0, 1)))[0]
    )
    q, rest = np.empty((len(samples) - 1, 4)), samples.piece(slice(1, None))
    assert rest.mag is not None
    for i, (gyr, acc, mag) in enumerate(
        zip(np.degrees(rest.gyr), rest.acc / 9.80665, rest.mag, strict=True)
    ):
        if magnetometer:
            theirs.update(gyr, acc, mag)
        else:
            theirs.update_no_magnetometer(gyr, acc)
        q[i] = theirs.get_quaternion()
    return q


def disturbed(samples: UniformSamples) -> UniformSamples:
    """Shaken for two seconds of every six, with a field that is bent for three of every eight, and
    a turn too fast.
    """
    time = np.arange(len(samples)) * samples.interval
    shaken, bent = (time % 6 > 4)[:, None], (time % 8 > 5)[:, None]
    gyr, acc = samples.gyr.copy(), samples.acc + shaken * np.array([6.0, -4.0, 2.0])
    assert samples.mag is not None
    gyr[(time > 20) & (time < 20.2)] *= 40.0
    return replace(
        samples, gyr=gyr, acc=acc, mag=samples.mag + bent * np.array([30.0, -20.0, 10.0])
    )


@pytest.mark.parametrize("magnetometer", [False, True])
@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"gain": 0.7, "acceleration_rejection_deg": 0.0},
        {"rejection_timeout_s": 0.5},
        {"rejection_timeout_s": 0.0},
        {"gyroscope_range_deg_s": 300.0},
        {"gain": 0.0},
    ],
)
def test_fusion_is_its_authors_package(parameters, magnetometer):
    """In single precision there; a rejection decided the other way at its threshold would show as
    tenths of a degree.
    """
    samples = disturbed(SAMPLES)
    ours = get_filter("fusion_9d" if magnetometer else "fusion", parameters).run(samples)
    assert degrees_between(ours[1:], imufusion_loop(samples, parameters, magnetometer)) < 5e-3

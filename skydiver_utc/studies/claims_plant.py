# SPDX-License-Identifier: Apache-2.0
"""Claims about the skydiver: what the pose controller, the posture and the hands can do."""

from collections.abc import Iterator

from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.claim import CLEARLY, Claim, amplitude, decided, listed, rmse_of
from skydiver_utc.studies.markdown import figure, percent
from skydiver_utc.studies.paper_results import PaperResults

# A simple maneuver is followed with an RMSE of at most this share of its amplitude.
_FOLLOWED_SHARE = 0.1


def of_plant(results: PaperResults) -> Iterator[Claim]:
    """In the paper's order."""
    yield _linear_control(results)

    fast = results.of(flown.POSE_FAST)
    yield decided(
        "The pose controller with constant damping cannot track the fast turn (`ff6`)",
        "never inside 5 % for good",
        f"RMSE {figure(fast.rmse)}, peak {figure(fast.peak_yaw_rate_deg_s)} of"
        f" {figure(amplitude(flown.POSE_FAST))} deg/s",
        [fast.convergence_time_s is None],
    )

    posture = results.of(flown.POSTURE_ALONE)
    yield decided(
        "Posture adjustments alone cannot do it, whoever commands them: their size is limited",
        "UTC with the damping held at 0.5 and hands without force is never inside 5 % for good",
        f"RMSE {figure(posture.rmse)}, peak {figure(posture.peak_yaw_rate_deg_s)} deg/s",
        [posture.convergence_time_s is None],
    )

    names = (flown.AS_PRINTED, flown.NO_HANDS, flown.FORCE_ALONE, flown.MOMENT_ALONE)
    own, without, force, moment = (rmse_of(results, flown.HANDS[name]) for name in names)
    by_speed = all(f <= CLEARLY * o and m >= CLEARLY * o for o, f, m in zip(own, force, moment, strict=True))
    speeds = [results.of(one).largest_speed_m_s for one in (flown.M0_C2, flown.HANDS[flown.NO_HANDS][0])]
    yield decided(
        "So the adjustment of input moments becomes necessary, beside that of the damping",
        f"each of the paper's three configurations is at least {flown.NECESSARY:g} times worse without hands",
        f"RMSE {listed(own)} with the hands, {listed(without)} without",
        [worse >= flown.NECESSARY * better for better, worse in zip(own, without, strict=True)],
        remark=f"{'The number, not the mechanism: it is the airspeed' if by_speed else 'Largest airspeed'}"
        f" ({figure(speeds[0])} m/s, without hands {figure(speeds[1])})"
        f"{' and not the bank' if by_speed else ''}. The force alone gives {listed(force)}, the roll moment alone"
        f" {listed(moment)}.",
    )

    push = results.push
    yield decided(
        "A hand's roll moment banks the body, which makes a yaw moment in the sense of the turn (eq_force2, eq_q1)",
        "the left hand, pressed fully for 1 s in a straight fall, banks the body and yaws it to the left",
        f"{figure(abs(push.bank_right_deg))} deg, {'left' if push.bank_right_deg < 0.0 else 'right'} side down;"
        f" {figure(push.yaw_rate_deg_s)} deg/s to the left",
        [abs(push.bank_right_deg) > 1.0, push.yaw_rate_deg_s > 0.0],
        "The yaw that follows has the other sign or is none.",
        f"True of one hand in a straight fall; in the fast turn the bank comes too late ({listed(moment)}).",
    )


def _linear_control(results: PaperResults) -> Claim:
    slow, fast = (
        [results.of(one).rmse / amplitude(one) for one in cases]
        for cases in ((flown.LQR_SLOW, flown.POSE_SLOW), (flown.LQR_FAST, flown.POSE_FAST))
    )
    both = results.of(flown.LQR_BOTH).rmse / amplitude(flown.LQR_SLOW)
    lqr, pose = (f"{100.0 * s:.1f} % and {100.0 * f:.1f} %" for s, f in zip(slow, fast, strict=True))
    return decided(
        "A linear controller follows simple maneuvers and fails the complex one",
        f"RMSE at most {percent(_FOLLOWED_SHARE)} of the amplitude in the slow turn, more in the fast one",
        f"linear-quadratic regulator {lqr}, pose controller {pose}",
        [share <= _FOLLOWED_SHARE for share in slow] + [share > _FOLLOWED_SHARE for share in fast],
        "What fails the fast turn is a constant damping of 0.5, not linearity: a regulator with low damping and free"
        f" hands tracks it. Its costs do not serve both turns: those of the fast one give {100.0 * both:.0f} % in the"
        " slow one.",
    )

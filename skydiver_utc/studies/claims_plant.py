# SPDX-License-Identifier: Apache-2.0
"""Claims about the skydiver: what the pose controller, the posture and the hands can do."""

from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.claim import PAPER_UTC, Claim, amplitude, judge, listed, rmse_of
from skydiver_utc.studies.markdown import figure, percent
from skydiver_utc.studies.paper_results import PaperResults

# A simple maneuver is followed with an RMSE of at most this share of its amplitude.
_FOLLOWED_SHARE = 0.1


def linear_control(results: PaperResults) -> Claim:
    """Robust linear control: enough for simple maneuvers only."""
    slow = [results.of(one).rmse / amplitude(one) for one in (flown.LQR_SLOW, flown.POSE_SLOW)]
    fast = [results.of(one).rmse / amplitude(one) for one in (flown.LQR_FAST, flown.POSE_FAST)]
    return Claim(
        "A linear controller follows simple maneuvers and fails the complex one",
        f"RMSE at most {percent(_FOLLOWED_SHARE)} of the amplitude in the slow turn, more in the fast one",
        f"linear-quadratic regulator {percent(slow[0])} and {percent(fast[0])}; pose controller {percent(slow[1])}"
        f" and {percent(fast[1])}",
        judge([share <= _FOLLOWED_SHARE for share in slow] + [share > _FOLLOWED_SHARE for share in fast]),
    )


def pose_fails(results: PaperResults) -> Claim:
    """Figure ff6."""
    fast = results.of(flown.POSE_FAST)
    return Claim(
        "The pose controller with constant damping cannot track the fast turn (`ff6`)",
        "never inside 5 % for good",
        f"RMSE {figure(fast.rmse)}, peak {figure(fast.peak_yaw_rate_deg_s)} of"
        f" {figure(amplitude(flown.POSE_FAST))} deg/s",
        judge([fast.convergence_time_s is None]),
    )


def posture_alone(results: PaperResults) -> Claim:
    """Why further controls are needed."""
    found = results.of(flown.POSTURE_ALONE)
    return Claim(
        "Posture adjustments alone cannot do it, whoever commands them: their size is limited",
        "UTC with the damping held at 0.5 and hands without force is never inside 5 % for good",
        f"RMSE {figure(found.rmse)}, peak {figure(found.peak_yaw_rate_deg_s)} deg/s",
        judge([found.convergence_time_s is None]),
    )


def hands_needed(results: PaperResults) -> Claim:
    """Whether the hands help."""
    with_hands, without = rmse_of(results, PAPER_UTC), rmse_of(results, flown.HANDS_IDLE)
    return Claim(
        "So the adjustment of input moments becomes necessary, beside that of the damping",
        "each of the paper's three configurations is worse when its hands have no force (K_N = 0)",
        f"RMSE {listed(with_hands)} with the hands, {listed(without)} without",
        judge([worse > better for better, worse in zip(with_hands, without, strict=True)]),
    )


def hands_turn(results: PaperResults) -> Claim:
    """Whether a hand does what eq_force2 is for."""
    push, printed = results.push, results.push_printed
    return Claim(
        "A hand's roll moment banks the body, which makes a yaw moment in the sense of the turn (eq_force2, eq_q1)",
        "the left hand, pressed fully for 1 s in a straight fall, banks the body and yaws it to the left",
        f"K_N = 10 N: bank {figure(push.bank_right_deg)} deg, yaw rate {figure(push.yaw_rate_deg_s)} deg/s (left"
        f" positive); 100 N: {figure(printed.bank_right_deg)} deg, {figure(printed.yaw_rate_deg_s)} deg/s",
        judge([abs(push.bank_right_deg) > 1.0, push.yaw_rate_deg_s > 0.0]),
    )

//! The deviation monitor and the life of a local replan: request, answer, splice.

use super::Agent;
use super::modes::Trigger;
use super::offer::Refusal;
use super::paths::Committed;
use super::phases::Path;
use crate::io::Output;
use crate::{SolveRequest, SolveResult};
use fleet_core::monitor::{DeviationMonitor, Observation};
use fleet_core::replan::LONGEST;
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::{Nanos, Reference, State, Vec3};
use fleet_core::wire::{DronePlan, EventKind, Mode, RejectCode, ReplanNotice, ReplanOutcome, Up};

/// A splice lies this far ahead of the request [s]: a solve takes about 20 ms.
const LEAD: f64 = 0.05;
/// After late answers the lead doubles up to this [s].
const LEAD_MAX: f64 = 0.2;
/// Late answers in a row after which the drone holds.
const LATES_MAX: u32 = 4;
/// An answer that takes longer than this never comes [s].
const PATIENCE: f64 = 0.5;
/// Least time between two requests [s]: a pulse that goes on is answered again.
const SPACING: f64 = 0.2;
/// A rejoin lies at least this far behind the splice [s].
const REJOIN_MIN: f64 = 1.0;
/// Topic waypoints tried in one request.
const CANDIDATES: usize = 3;
/// Start and end of an answer may differ this much from what was asked [m, m/s, m/s^2]; solver
/// tolerance.
const SEAM: f64 = 0.01;

/// A request that is being solved.
#[derive(Clone, Debug, PartialEq)]
struct Outstanding {
    asked_at: Nanos,
    request: SolveRequest,
}

/// State of the replanner's conversation.
#[derive(Clone, Debug, Default)]
pub struct Replanning {
    /// Made anew whenever the plan was not followed for a while.
    monitor: Option<DeviationMonitor>,
    outstanding: Option<Outstanding>,
    /// A checked piece that begins in a moment.
    next: Option<Trajectory>,
    last_request: Option<Nanos>,
    last_id: u64,
    lates: u32,
    /// Replans committed so far.
    pub committed: u32,
}

impl Replanning {
    /// Forgets what is under way; its answer will be ignored.
    pub fn drop_request(&mut self) {
        self.outstanding = None;
        self.next = None;
        self.lates = 0;
        self.monitor = None;
    }
}

impl Agent {
    /// One tick on the plan or in hold: splice, end of plan, late answers, monitor.
    pub(super) fn advance_plan(&mut self, now: Nanos, t: Option<f64>) {
        let Some(t) = t else { return };
        if self.replan.next.as_ref().is_some_and(|piece| piece.start() <= t) {
            self.splice(now);
        }
        if let Path::Plan(committed) = &mut self.path {
            committed.advance(t);
            if t >= committed.fleet.end() {
                self.fire(now, Trigger::PlanEnd, "the plan's end");
                return;
            }
        }
        let overdue = self.replan.outstanding.as_ref().is_some_and(|o| now.since(o.asked_at) > PATIENCE);
        if overdue {
            self.retry(now, t, "no answer from the solver");
        } else if matches!(self.mode, Mode::Track | Mode::Replan) {
            self.monitor(now, t);
        }
    }

    /// Compares state and committed reference every T_e (paper, section IV-C).
    fn monitor(&mut self, now: Nanos, t: f64) {
        let busy = self.replan.outstanding.is_some() || self.replan.next.is_some();
        let recent = self.replan.last_request.is_some_and(|at| now.since(at) < SPACING);
        let fresh = self.vehicle.age(now).is_some_and(|age| age <= super::fly::COAST_AFTER);
        if busy || recent || !fresh {
            return;
        }
        let (Some(plan), Some(state)) = (&self.mission.committed, self.vehicle.state(now)) else { return };
        let (params, end) = (plan.plan.replan, plan.own().trajectory.end());
        let Some(reference) = self.reference(now) else { return };
        // The state is carried forward to now, so it is compared with the reference of now.
        let state = State { at: now, ..state };
        let monitor = self.replan.monitor.get_or_insert_with(|| DeviationMonitor::new(&params));
        let seen = monitor.update(&state, &reference.p, self.vehicle.reset_counter);
        // Estimator resets are reported where the position comes in; here they only silence a check.
        let Some(Observation::Deviation { metres }) = seen else { return };
        self.event(now, EventKind::Deviation { metres }, "deviation above eta");
        if !params.enabled || t + REJOIN_MIN + LEAD >= end {
            return;
        }
        self.fire(now, Trigger::Deviation, "deviation above eta");
        if !self.request(now, t, metres) {
            self.fire(now, Trigger::Unsolvable, "no topic waypoint within reach");
        }
    }

    /// Asks the solver for a way from the predicted state to the next topic waypoints; false when
    /// none can be reached.
    fn request(&mut self, now: Nanos, t: f64, deviation: f64) -> bool {
        let lead = (LEAD * f64::from(1 << self.replan.lates.min(8))).min(LEAD_MAX);
        let (Some(plan), Some(state)) = (&self.mission.committed, self.vehicle.state(now)) else {
            return false;
        };
        let reference = self.reference(now.plus(lead)).unwrap_or(Reference::rest(state.p, self.heading(now)));
        let mut start =
            predict(&state, self.controller.without_integral(&self.acceleration), t, lead, &reference);
        // The commanded acceleration must not step at the splice, however wrong the prediction is.
        start.a = self.controller.handover(&start.p, &start.v, &reference);
        let rejoin = candidates(plan.own(), &start, plan.plan.limits.v_max);
        if rejoin.is_empty() {
            return false;
        }
        self.replan.last_id += 1;
        self.replan.last_request = Some(now);
        let request = SolveRequest {
            id: self.replan.last_id,
            hash: plan.hash.clone(),
            t_event: t,
            deviation,
            start,
            rejoin,
        };
        self.replan.outstanding = Some(Outstanding { asked_at: now, request: request.clone() });
        self.out.push(Output::Solve(Box::new(request)));
        true
    }

    /// Takes the solver's answer; anything but a checked trajectory keeps the committed plan.
    pub(super) fn take_solved(&mut self, now: Nanos, solution: &SolveResult) {
        let Some(outstanding) = &self.replan.outstanding else { return };
        if outstanding.request.id != solution.id || outstanding.request.hash != solution.hash {
            return;
        }
        let Some(t) = self.mission.time(now) else { return };
        let request = outstanding.request.clone();
        let piece = match self.check(&request, solution) {
            Ok(piece) => piece,
            Err((outcome, reason)) => {
                self.replan.drop_request();
                self.notice(now, &request, outcome, None);
                self.fire(now, Trigger::Unsolvable, &reason);
                return;
            }
        };
        if t > request.start.t {
            self.retry(now, t, "the answer came after its splice");
            return;
        }
        self.replan.outstanding = None;
        self.replan.lates = 0;
        self.notice(now, &request, ReplanOutcome::Committed, Some(&piece));
        self.replan.next = Some(piece);
    }

    fn check(
        &self,
        request: &SolveRequest,
        solution: &SolveResult,
    ) -> Result<Trajectory, (ReplanOutcome, String)> {
        let refuse = |reason: &str| (ReplanOutcome::Refused, reason.to_owned());
        if solution.outcome != ReplanOutcome::Committed {
            return Err((solution.outcome, solution.reason.clone()));
        }
        let (Some(piece), Some(t_rejoin)) = (&solution.trajectory, solution.t_rejoin) else {
            return Err(refuse("the solver gave no trajectory"));
        };
        let Some(plan) = &self.mission.committed else { return Err(refuse("no plan is committed")) };
        let (first, last) = (piece.sample(piece.start()), piece.sample(piece.end()));
        let fleet = plan.own().trajectory.sample(t_rejoin);
        let in_time = (piece.start() - request.start.t).abs() < 1e-6 && (piece.end() - t_rejoin).abs() < 1e-6;
        let seams = (first.p - request.start.p).norm() < SEAM
            && (first.v - request.start.v).norm() < SEAM
            && (first.a - request.start.a).norm() < SEAM
            && (last.p - fleet.p).norm() < SEAM
            && (last.v - fleet.v).norm() < SEAM
            && (last.a - fleet.a).norm() < SEAM;
        if in_time && seams { Ok(piece.clone()) } else { Err(refuse("the solver's trajectory does not fit")) }
    }

    /// A late or missing answer: asks again with a longer lead, and gives up after a few.
    fn retry(&mut self, now: Nanos, t: f64, why: &str) {
        let Some(outstanding) = self.replan.outstanding.take() else { return };
        self.replan.lates += 1;
        let lates = self.replan.lates;
        self.notice(now, &outstanding.request, ReplanOutcome::Late, None);
        if lates > LATES_MAX || !self.request(now, t, outstanding.request.deviation) {
            self.replan.drop_request();
            self.fire(now, Trigger::Unsolvable, why);
        }
    }

    /// The piece begins: it is the committed reference from now on.
    fn splice(&mut self, now: Nanos) {
        let Some(piece) = self.replan.next.take() else { return };
        let Some(plan) = &self.mission.committed else { return };
        let fleet = plan.own().trajectory.clone();
        self.path = Path::Plan(Committed { fleet, local: Some(piece) });
        self.replan.committed += 1;
        // From now on the deviation counts against the new reference.
        if let Some(monitor) = &mut self.replan.monitor {
            monitor.rearm();
        }
        self.fire(now, Trigger::Spliced, "local replan");
    }

    /// Leaves hold: back to the plan where a topic waypoint can be reached, else home.
    pub(super) fn resume_plan(&mut self, now: Nanos) -> Result<(), Refusal> {
        let end = self.mission.committed.as_ref().map(|plan| plan.own().trajectory.end());
        let Some((t, end)) = self.mission.time(now).zip(end) else {
            return Err((RejectCode::Mode, "no start time is known: return or land".to_owned()));
        };
        if t < 0.0 {
            return Err((RejectCode::Mode, "mission time is negative: wait, return or land".to_owned()));
        }
        if t >= end {
            self.fire(now, Trigger::Return, "resumed after the plan's end");
            return Ok(());
        }
        let busy = self.replan.outstanding.is_some() || self.replan.next.is_some();
        if busy || self.request(now, t, self.deviation.unwrap_or(0.0)) {
            return Ok(());
        }
        Err((RejectCode::Mode, "no topic waypoint can be reached any more: return or land".to_owned()))
    }

    fn notice(
        &mut self,
        now: Nanos,
        request: &SolveRequest,
        outcome: ReplanOutcome,
        piece: Option<&Trajectory>,
    ) {
        let notice = ReplanNotice {
            drone: self.config.drone.clone(),
            outcome,
            t_event: request.t_event,
            deviation: request.deviation,
            t_splice: piece.map(Trajectory::start),
            t_rejoin: piece.map(Trajectory::end),
            trajectory: piece.cloned(),
        };
        self.publish(now, Up::Replan(notice));
    }
}

/// The measured state `lead` seconds on, at constant acceleration, with the reference's heading.
fn predict(state: &State, a: Vec3, t: f64, lead: f64, reference: &Reference) -> Knot {
    Knot {
        t: t + lead,
        p: state.p + state.v * lead + a * (0.5 * lead * lead),
        v: state.v + a * lead,
        a,
        psi: reference.psi,
        psi_rate: reference.psi_rate,
        psi_acc: 0.0,
    }
}

/// The next topic waypoints that a vehicle at `start` could reach at `v_max` per axis; the end of the
/// plan is one.
fn candidates(own: &DronePlan, start: &Knot, v_max: f64) -> Vec<f64> {
    let end = own.trajectory.end();
    let mut times: Vec<f64> = own.topics.iter().copied().filter(|t| *t < end - 1e-6).chain([end]).collect();
    times.retain(|t| {
        let left = t - start.t;
        (REJOIN_MIN..=LONGEST).contains(&left)
            && (own.trajectory.position(*t) - start.p).amax() <= v_max * left
    });
    times.truncate(CANDIDATES);
    times
}

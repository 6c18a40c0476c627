//! The thread that solves replans.

use super::Wake;
use super::plans::Plans;
use super::queue::Queue;
use crate::io::Input;
use crate::{SolveRequest, SolveResult};
use fleet_core::replan::Replanner;
use fleet_core::wire::ReplanOutcome;
use std::sync::mpsc::Receiver;

/// Work for the solver.
#[derive(Debug)]
pub enum Job {
    /// A plan was committed: get its corridors ready before the first deviation.
    Prepare {
        /// Its hash.
        hash: String,
    },
    /// Solve and answer on the wake queue.
    Solve(Box<SolveRequest>),
}

/// Works until the jobs end.
pub fn run(drone: &str, plans: &Plans, jobs: &Receiver<Job>, wake: &Queue<Wake>) {
    let mut ready: Option<(String, Replanner)> = None;
    for job in jobs {
        match job {
            Job::Prepare { hash } => {
                if let Err(reason) = prepare(drone, plans, &hash, &mut ready) {
                    tracing::warn!(hash, reason, "cannot prepare replanning");
                }
            }
            Job::Solve(request) => {
                let result = match prepare(drone, plans, &request.hash, &mut ready) {
                    Ok(replanner) => replanner.solve(&request),
                    Err(reason) => refused(&request, reason),
                };
                if wake.offer(Wake::Input(Input::Solved(result))).is_err() {
                    tracing::error!(id = request.id, "a replan was solved but the answer is lost");
                }
            }
        }
    }
}

/// The answer when a request cannot be solved at all.
#[must_use]
pub fn refused(request: &SolveRequest, reason: String) -> SolveResult {
    SolveResult {
        id: request.id,
        hash: request.hash.clone(),
        outcome: ReplanOutcome::Refused,
        trajectory: None,
        t_rejoin: None,
        reason,
    }
}

fn prepare<'a>(
    drone: &str,
    plans: &Plans,
    hash: &str,
    ready: &'a mut Option<(String, Replanner)>,
) -> Result<&'a mut Replanner, String> {
    let known = ready.take().filter(|(of, _)| of == hash);
    let current = match known {
        Some(current) => current,
        None => {
            let file = plans.get(hash).ok_or_else(|| format!("plan {hash} was never committed"))?;
            let replanner = Replanner::new(&file.plan, drone).map_err(|error| error.to_string())?;
            (hash.to_owned(), replanner)
        }
    };
    Ok(&mut ready.insert(current).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fleet_core::trajectory::Knot;
    use fleet_core::types::Vec3;

    /// A request must always be answered: the step waits for its answer.
    #[test]
    fn a_request_for_an_unknown_plan_is_answered_with_the_reason() {
        let (wake, woken) = Queue::bounded("wake", 4);
        let (jobs, work) = Queue::bounded("jobs", 4);
        let start = Knot {
            t: 1.0,
            p: Vec3::zeros(),
            v: Vec3::zeros(),
            a: Vec3::zeros(),
            psi: 0.0,
            psi_rate: 0.0,
            psi_acc: 0.0,
        };
        let request = SolveRequest {
            id: 7,
            hash: "abc".to_owned(),
            t_event: 0.9,
            deviation: 0.5,
            start,
            rejoin: vec![5.0],
        };
        jobs.offer(Job::Prepare { hash: "abc".to_owned() }).unwrap();
        jobs.offer(Job::Solve(Box::new(request))).unwrap();
        drop(jobs);
        run("d1", &Plans::default(), &work, &wake);
        let Ok(Wake::Input(Input::Solved(answer))) = woken.try_recv() else { panic!("no answer") };
        assert_eq!((answer.id, answer.outcome), (7, ReplanOutcome::Refused));
        assert_eq!(answer.reason, "plan abc was never committed");
        assert!(woken.try_recv().is_err());
    }
}

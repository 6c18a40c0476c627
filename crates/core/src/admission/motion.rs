//! Checks of the trajectories over continuous time.

use super::{Refusal, refuse};
use crate::geometry::Polyhedron;
use crate::trajectory::clearance::{max_abs, min_inside, min_outside};
use crate::wire::{DronePlan, Plan, RejectCode};

/// Rounding by which a bound may be exceeded [its own unit]: an optimiser ends on its bounds.
const ROUNDING: f64 = 1e-6;
/// Largest horizontal distance between the pad and the first position [m]: take-off is straight up,
/// and at t0 the drone must be within this of its start (design.md, Start).
const ABOVE_PAD: f64 = 0.3;

/// Begins at rest above the own pad and ends at rest inside home.
pub fn ends(plan: &Plan) -> Result<(), Refusal> {
    for d in &plan.drones {
        let knots = d.trajectory.knots();
        let (first, last) = (&knots[0], &knots[knots.len() - 1]);
        for (name, k) in [("start", first), ("end", last)] {
            let moving = k.v.amax().max(k.a.amax()).max(k.psi_rate.abs());
            if moving > ROUNDING {
                return refuse(RejectCode::Ends, format!("drone {}: not at rest at its {name}", d.id));
            }
        }
        let from_pad = first.p - d.pad.p;
        if from_pad.xy().norm() > ABOVE_PAD || from_pad.z < -ROUNDING {
            return refuse(
                RejectCode::Ends,
                format!(
                    "drone {}: starts {:.2} m beside and {:.2} m above its pad; legal is at most {ABOVE_PAD} m beside, and above",
                    d.id,
                    from_pad.xy().norm(),
                    from_pad.z
                ),
            );
        }
        let margin = region(plan, &d.home)?.inside(&last.p);
        if margin < 0.0 {
            return refuse(
                RejectCode::Ends,
                format!("drone {}: ends {:.2} m outside {}", d.id, -margin, d.home),
            );
        }
    }
    Ok(())
}

/// Velocity, acceleration and heading rate within the plan's limits.
pub fn limits(plan: &Plan) -> Result<(), Refusal> {
    let l = &plan.limits;
    for d in &plan.drones {
        for segment in 0..d.trajectory.segments() {
            let q = d.trajectory.quintic(segment);
            let heading = d.trajectory.heading_quintic(segment);
            let found = [
                ("velocity", max_abs(&q.velocity_points(), l.v_max).max(), l.v_max),
                ("acceleration", max_abs(&q.acceleration_points(), l.a_max).max(), l.a_max),
                ("heading rate", max_abs(&heading.velocity_points(), l.psi_rate_max).x, l.psi_rate_max),
            ];
            for (name, value, most) in found {
                if value > most + ROUNDING {
                    return refuse(
                        RejectCode::Limits,
                        format!("{}: {name} {value:.4} is above {most}", place(d, segment)),
                    );
                }
            }
        }
    }
    Ok(())
}

/// Inside the workspace and outside every obstacle.
pub fn clearance(plan: &Plan) -> Result<(), Refusal> {
    let workspace = region(plan, &plan.workspace)?;
    let obstacles = plan
        .obstacles
        .iter()
        .map(|name| Ok((name, region(plan, name)?)))
        .collect::<Result<Vec<(&String, &Polyhedron)>, Refusal>>()?;
    for d in &plan.drones {
        for segment in 0..d.trajectory.segments() {
            let q = d.trajectory.quintic(segment);
            if min_inside(&q, workspace, 0.0) < -ROUNDING {
                return refuse(RejectCode::Clearance, format!("{}: leaves the workspace", place(d, segment)));
            }
            for (name, obstacle) in &obstacles {
                if min_outside(&q, obstacle, ROUNDING) <= 0.0 {
                    return refuse(RejectCode::Clearance, format!("{}: enters {name}", place(d, segment)));
                }
            }
        }
    }
    Ok(())
}

/// Every two drones at least `delta_min` apart at every time.
pub fn separation(plan: &Plan) -> Result<(), Refusal> {
    let least = plan.limits.delta_min;
    for (i, a) in plan.drones.iter().enumerate() {
        for b in &plan.drones[i + 1..] {
            let end = a.trajectory.end().min(b.trajectory.end());
            let distance = a.trajectory.min_distance(&b.trajectory, 0.0, end, least);
            if distance < least - ROUNDING {
                return refuse(
                    RejectCode::Separation,
                    format!("drones {} and {} come within {distance:.3} m; delta_min is {least}", a.id, b.id),
                );
            }
        }
    }
    Ok(())
}

fn region<'a>(plan: &'a Plan, name: &str) -> Result<&'a Polyhedron, Refusal> {
    plan.region(name).ok_or_else(|| (RejectCode::Malformed, format!("region {name:?} is used but not given")))
}

fn place(d: &DronePlan, segment: usize) -> String {
    format!("drone {} in the segment from {:.2} s", d.id, d.trajectory.knots()[segment].t)
}

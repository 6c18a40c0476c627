//! Checks of what the plan says, without its motion.

use super::{Refusal, VehicleLimits, refuse};
use crate::wire::keys::is_name;
use crate::wire::{DronePlan, Plan, PlanStatus, RejectCode, SCHEMA};
use std::collections::BTreeSet;

/// Most drones of a plan; with the size of a message it bounds the time of the pair checks.
const MAX_DRONES: usize = 64;
/// Longest mission [s].
const MAX_HORIZON: f64 = 3600.0;
/// Rounding of a time that is a sum of decimal fractions [s].
const SAME_TIME: f64 = 1e-6;

pub fn schema(plan: &Plan) -> Result<(), Refusal> {
    if plan.schema != SCHEMA {
        return refuse(
            RejectCode::Malformed,
            format!("schema is {}; this build speaks {SCHEMA}", plan.schema),
        );
    }
    Ok(())
}

pub fn fleet(plan: &Plan, drone: &str, fleet: &str) -> Result<(), Refusal> {
    if plan.fleet != fleet {
        return refuse(
            RejectCode::WrongFleet,
            format!("fleet is {:?}; this drone flies in {fleet:?}", plan.fleet),
        );
    }
    if plan.drones.is_empty() || plan.drones.len() > MAX_DRONES {
        return refuse(
            RejectCode::Malformed,
            format!("drones: {} of them; 1 to {MAX_DRONES} are legal", plan.drones.len()),
        );
    }
    let mut seen = BTreeSet::new();
    for d in &plan.drones {
        if !is_name(&d.id) || !seen.insert(&d.id) {
            return refuse(
                RejectCode::Malformed,
                format!("drones: id {:?} is not a name or stands twice", d.id),
            );
        }
    }
    if plan.drone(drone).is_none() {
        return refuse(RejectCode::NotInPlan, format!("drone {drone} is not in the plan"));
    }
    Ok(())
}

pub fn times(plan: &Plan) -> Result<(), Refusal> {
    let malformed = |reason: String| refuse(RejectCode::Malformed, reason);
    if !(plan.sample > 0.0 && plan.horizon >= plan.sample && plan.horizon <= MAX_HORIZON) {
        return malformed(format!(
            "horizon {} s with samples of {} s; legal is a positive sample, no longer than the horizon, of at most {MAX_HORIZON} s",
            plan.horizon, plan.sample
        ));
    }
    let r = &plan.replan;
    if !(r.t_e > 0.0 && r.t_g > 0.0 && r.eta > 0.0) {
        return malformed(format!("replan: t_e {}, t_g {}, eta {} must be positive", r.t_e, r.t_g, r.eta));
    }
    for d in &plan.drones {
        let (start, end) = (d.trajectory.start(), d.trajectory.end());
        if start.abs() > SAME_TIME || (end - plan.horizon).abs() > SAME_TIME {
            return malformed(format!(
                "drone {}: the trajectory covers {start} to {end} s, not 0 to {} s",
                d.id, plan.horizon
            ));
        }
        listed_times(d, plan.horizon)?;
    }
    Ok(())
}

/// Topics rise within the mission, visits lie in their windows.
fn listed_times(d: &DronePlan, horizon: f64) -> Result<(), Refusal> {
    let within = |t: f64| (-SAME_TIME..=horizon + SAME_TIME).contains(&t);
    let rising = d.topics.windows(2).all(|w| w[0] < w[1]);
    if !rising || !d.topics.iter().all(|t| within(*t)) {
        return refuse(
            RejectCode::Malformed,
            format!("drone {}: topics do not rise within 0 to {horizon} s", d.id),
        );
    }
    for visit in &d.visits {
        let [from, to] = visit.window;
        if !within(visit.t) || visit.t < from - SAME_TIME || visit.t > to + SAME_TIME {
            return refuse(
                RejectCode::Malformed,
                format!(
                    "drone {}: visit of {} at {} s is not in {from} to {to} s",
                    d.id, visit.region, visit.t
                ),
            );
        }
    }
    Ok(())
}

pub fn limits(plan: &Plan, vehicle: &VehicleLimits) -> Result<(), Refusal> {
    let l = &plan.limits;
    for (name, value, most) in [
        ("v_max", l.v_max, vehicle.v_max),
        ("a_max", l.a_max, vehicle.a_max),
        ("psi_rate_max", l.psi_rate_max, vehicle.psi_rate_max),
    ] {
        if !(value > 0.0 && value <= most) {
            return refuse(
                RejectCode::Limits,
                format!("limits.{name} is {value}; the vehicle allows at most {most}"),
            );
        }
    }
    if !(l.delta_min >= 0.0 && l.tube >= 0.0) {
        return refuse(
            RejectCode::Limits,
            format!("limits.delta_min {} and limits.tube {} must not be negative", l.delta_min, l.tube),
        );
    }
    Ok(())
}

pub fn regions(plan: &Plan) -> Result<(), Refusal> {
    let mut names = BTreeSet::new();
    if let Some(twice) = plan.regions.iter().find(|r| !names.insert(r.name.as_str())) {
        return refuse(RejectCode::Malformed, format!("regions: {:?} stands twice", twice.name));
    }
    let visits = plan.drones.iter().flat_map(|d| d.visits.iter().map(|v| &v.region));
    let homes = plan.drones.iter().map(|d| &d.home);
    let used = std::iter::once(&plan.workspace).chain(&plan.obstacles).chain(homes).chain(visits);
    for name in used {
        if !names.contains(name.as_str()) {
            return refuse(RejectCode::Malformed, format!("region {name:?} is used but not given"));
        }
    }
    Ok(())
}

pub fn certificate(plan: &Plan) -> Result<(), Refusal> {
    if plan.status == PlanStatus::Violated {
        return refuse(RejectCode::Certificate, "the plan says itself that it violates the mission");
    }
    if plan.clauses.is_empty() {
        return refuse(RejectCode::Certificate, "the plan carries no clauses, so it proves nothing");
    }
    for clause in &plan.clauses {
        let r = &clause.result;
        if !(r.rho_lower > 0.0 && r.rho >= r.rho_lower) {
            return refuse(
                RejectCode::Certificate,
                format!(
                    "clause {}: rho {} and rho_lower {}; legal is 0 < rho_lower <= rho",
                    clause.id, r.rho, r.rho_lower
                ),
            );
        }
    }
    let least = plan.clauses.iter().map(|c| c.result.rho_lower).fold(f64::INFINITY, f64::min);
    if !(plan.rho_lower > 0.0 && plan.rho_lower <= least + 1e-9) {
        return refuse(
            RejectCode::Certificate,
            format!("rho_lower {} is not positive or above the least clause's {least}", plan.rho_lower),
        );
    }
    Ok(())
}

//! The way home of the return mode: up to below the roof of the workspace, across, and over the pad.
//!
//! First form of safety.md's return branch: where something is in the way straight up (a cable), the
//! drone first moves aside by the least of a few tried distances.

use fleet_core::geometry::Polyhedron;
use fleet_core::types::Vec3;
use fleet_core::wire::Plan;

/// Clearance kept from obstacles on the way home [m]; they are already inflated by the vehicle.
const CLEARANCE: f64 = 0.5;
/// Spacing of the points at which clearance is checked [m]; it can lose at most half of this.
const STEP: f64 = 0.2;
/// Distances to the side that are tried [m].
const ASIDE: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
/// Directions that are tried.
const DIRECTIONS: u32 = 16;

/// Corners of the way from `from` to the point over `pad`, `margin` below the roof [m]. When nothing
/// that is tried is free, straight up: the first form offers no better.
#[must_use]
pub fn corners(plan: &Plan, from: &Vec3, pad: &Vec3, margin: f64) -> Vec<Vec3> {
    let Some(workspace) = plan.region(&plan.workspace) else { return vec![*from] };
    let obstacles: Vec<&Polyhedron> = plan.obstacles.iter().filter_map(|name| plan.region(name)).collect();
    let straight = route(workspace, from, from, pad, margin);
    let sides = ASIDE.iter().flat_map(|distance| {
        (0..DIRECTIONS).map(move |k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS);
            Vec3::new(angle.cos(), angle.sin(), 0.0) * *distance
        })
    });
    let mut tried = std::iter::once(Vec3::zeros())
        .chain(sides)
        .map(|side| route(workspace, from, &(from + side), pad, margin));
    let free = |way: &Vec<Vec3>| {
        let starts = std::iter::once(from).chain(way.iter());
        starts.zip(way.iter()).all(|(a, b)| is_free(workspace, &obstacles, a, b))
    };
    tried.find(free).unwrap_or(straight)
}

/// Aside, up, across; never down on the way.
fn route(workspace: &Polyhedron, from: &Vec3, aside: &Vec3, pad: &Vec3, margin: f64) -> Vec<Vec3> {
    let over_pad = Vec3::new(pad.x, pad.y, from.z);
    let roof = ceiling(workspace, aside).min(ceiling(workspace, &over_pad)) - margin;
    let height = roof.max(from.z);
    let mut way = vec![Vec3::new(aside.x, aside.y, height), Vec3::new(pad.x, pad.y, height)];
    if aside != from {
        way.insert(0, *aside);
    }
    way
}

fn is_free(workspace: &Polyhedron, obstacles: &[&Polyhedron], a: &Vec3, b: &Vec3) -> bool {
    let count = ((b - a).norm() / STEP).ceil().max(1.0) as usize;
    (0..=count).all(|k| {
        let p = a + (b - a) * (k as f64 / count as f64);
        workspace.inside(&p) >= 0.0 && obstacles.iter().all(|o| o.outside(&p) >= CLEARANCE)
    })
}

/// Largest height over `p` that is inside `workspace` [m]; the height of `p` when it has no roof.
fn ceiling(workspace: &Polyhedron, p: &Vec3) -> f64 {
    let above = workspace.faces().iter().filter(|f| f.a.z > 1e-6);
    let roof = above.map(|f| (f.b - f.a.x * p.x - f.a.y * p.y) / f.a.z).fold(f64::INFINITY, f64::min);
    if roof.is_finite() { roof } else { p.z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::tests::plans::plan;
    use fleet_core::wire::Region;

    const PAD: Vec3 = Vec3::new(5.0, 5.0, 0.1);

    fn with_cable() -> Plan {
        let mut plan = plan(&[("d1", PAD)]);
        let shape =
            Polyhedron::from_box(Vec3::new(-0.3, -20.0, 10.0), Vec3::new(0.3, 20.0, 10.6)).expect("box");
        plan.regions.push(Region { name: "cable".into(), shape });
        plan.obstacles.push("cable".into());
        plan
    }

    #[test]
    fn goes_straight_up_where_it_can() {
        let from = Vec3::new(3.0, 0.0, 5.0);
        let way = corners(&with_cable(), &from, &PAD, 0.8);
        assert_eq!(way, vec![Vec3::new(3.0, 0.0, 14.2), Vec3::new(5.0, 5.0, 14.2)]);
    }

    #[test]
    fn moves_aside_under_a_cable() {
        let (plan, from) = (with_cable(), Vec3::new(0.1, 0.0, 5.0));
        let way = corners(&plan, &from, &PAD, 0.8);
        assert_eq!(way.len(), 3);
        let cable = plan.region("cable").expect("given");
        let points = std::iter::once(from).chain(way.iter().copied()).collect::<Vec<_>>();
        for pair in points.windows(2) {
            for k in 0..=100 {
                let p = pair[0] + (pair[1] - pair[0]) * (f64::from(k) / 100.0);
                assert!(cable.outside(&p) >= CLEARANCE - STEP / 2.0, "{p}");
            }
        }
    }

    #[test]
    fn never_goes_down_on_the_way() {
        let way = corners(&with_cable(), &Vec3::new(4.0, 0.0, 14.9), &PAD, 0.8);
        assert!(way.iter().all(|p| p.z >= 14.9));
    }
}

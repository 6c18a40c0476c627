//! Where a local replan may fly: half-spaces per slot of mission time, made from the fleet plan alone.

use super::grid::SLOT;
use crate::geometry::{HalfSpace, Polyhedron};
use crate::trajectory::Trajectory;
use crate::types::{Limits, Vec3};

/// Farther from the plan than this an obstacle or peer poses nothing [m]; the check after the solve
/// looks at all of them.
const FAR: f64 = 8.0;

/// What a half-space keeps clear of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// A face of the workspace.
    Workspace(usize),
    /// An obstacle, by its place in the plan.
    Obstacle(usize),
    /// A peer, by its place in the plan.
    Peer(usize),
}

/// `normal . p >= at + rate (t - from)`: a half-space that may move at a constant speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// What is on the other side.
    pub source: Source,
    /// Unit vector towards the free side.
    pub normal: Vec3,
    /// Offset at `from` [m].
    pub at: f64,
    /// Speed of the plane along the normal [m/s].
    pub rate: f64,
    /// Start of the slot [s].
    pub from: f64,
    /// How far the fleet plan stays beyond the plane over the slot [m].
    pub spare: f64,
}

impl Side {
    /// Offset of the plane at mission time `t` [m].
    pub fn offset(&self, t: f64) -> f64 {
        self.at + self.rate * (t - self.from)
    }
}

/// Control points of a trajectory over one slot, each with its Greville time: a linear function of
/// time has its own values there as Bernstein coefficients, so planes that move linearly compare
/// with control points one by one.
struct Hull {
    points: Vec<(f64, Vec3)>,
}

impl Hull {
    fn over(trajectory: &Trajectory, from: f64, to: f64) -> Self {
        let mut points = Vec::new();
        for w in trajectory.breaks(from, to).windows(2) {
            let piece = trajectory.piece(w[0], w[1]);
            let time = |i: usize| w[0] + (w[1] - w[0]) * i as f64 / 5.0;
            points.extend(piece.points.iter().enumerate().map(|(i, p)| (time(i), *p)));
        }
        Self { points }
    }

    /// Least value of `f` over the control points.
    fn least(&self, f: impl Fn(f64, &Vec3) -> f64) -> f64 {
        self.points.iter().map(|(t, p)| f(*t, p)).fold(f64::INFINITY, f64::min)
    }
}

/// What the sides are made from.
pub struct Scene<'a> {
    /// Workspace.
    pub workspace: &'a Polyhedron,
    /// Obstacles in the plan's order.
    pub obstacles: &'a [Polyhedron],
    /// Every drone's trajectory in the plan's order.
    pub trajectories: &'a [Trajectory],
    /// Limits of the plan.
    pub limits: &'a Limits,
}

/// The sides of one drone for each slot of its trajectory, in the order of [`super::grid::slots`].
pub fn sides(scene: &Scene<'_>, own: usize) -> Vec<Vec<Side>> {
    let trajectory = &scene.trajectories[own];
    let count = (trajectory.end() / SLOT - 1e-9).ceil().max(1.0) as usize;
    (0..count)
        .map(|k| {
            let from = k as f64 * SLOT;
            slot_sides(scene, own, from, (from + SLOT).min(trajectory.end()))
        })
        .collect()
}

fn slot_sides(scene: &Scene<'_>, own: usize, from: f64, to: f64) -> Vec<Side> {
    let hull = Hull::over(&scene.trajectories[own], from, to);
    let tube = scene.limits.tube;
    let mut sides = Vec::new();
    for (i, face) in scene.workspace.faces().iter().enumerate() {
        let free = HalfSpace { a: -face.a, b: -face.b };
        sides.extend(keep_beyond(&hull, &free, from, tube, Source::Workspace(i)));
    }
    for (i, obstacle) in scene.obstacles.iter().enumerate() {
        let plane = separating_plane(obstacle, &hull, tube);
        sides.extend(keep_beyond(&hull, &plane, from, tube, Source::Obstacle(i)));
    }
    for (i, peer) in scene.trajectories.iter().enumerate() {
        if i != own {
            let (a, b) = if own < i { (own, i) } else { (i, own) };
            let pair = bisector(&scene.trajectories[a], &scene.trajectories[b], from, to, scene.limits);
            let far = (peer.position(from) - scene.trajectories[own].position(from)).norm()
                > 2.0 * FAR + scene.limits.delta_min;
            sides.extend(pair.filter(|_| !far).map(|p| p.side_of(own < i, from, Source::Peer(i))));
        }
    }
    sides
}

/// The side beyond `plane`. Half of the plan's own margin is kept, at most a whole tube: the plan
/// stays feasible with room to move, and a tracking error within the kept part is still clear.
fn keep_beyond(hull: &Hull, plane: &HalfSpace, from: f64, tube: f64, source: Source) -> Option<Side> {
    let margin = hull.least(|_, p| plane.a.dot(p) - plane.b);
    let kept = if margin > 0.0 { tube.min(0.5 * margin) } else { margin };
    (margin < FAR).then_some(Side {
        source,
        normal: plane.a,
        at: plane.b + kept,
        rate: 0.0,
        from,
        spare: margin - kept,
    })
}

/// The plane with the polyhedron behind it that the plan's control points are farthest beyond:
/// a face, or near an edge a weighted sum of two faces (also valid for every point of a convex
/// polyhedron).
fn separating_plane(obstacle: &Polyhedron, hull: &Hull, tube: f64) -> HalfSpace {
    let margin = |plane: &HalfSpace| hull.least(|_, p| plane.a.dot(p) - plane.b);
    let faces = obstacle.faces();
    let mut best = (f64::NEG_INFINITY, faces[0]);
    let consider = |best: &mut (f64, HalfSpace), plane: HalfSpace| {
        let m = margin(&plane);
        if m > best.0 {
            *best = (m, plane);
        }
    };
    for face in faces {
        consider(&mut best, *face);
    }
    // Two tubes leave a full tube on the kept half; no better plane is needed then.
    if best.0 < 2.0 * tube {
        for (i, f) in faces.iter().enumerate() {
            for g in &faces[i + 1..] {
                for w in [0.2, 0.4, 0.6, 0.8] {
                    let (a, b) = (f.a * w + g.a * (1.0 - w), f.b * w + g.b * (1.0 - w));
                    let norm = a.norm();
                    if norm > 1e-3 {
                        consider(&mut best, HalfSpace { a: a / norm, b: b / norm });
                    }
                }
            }
        }
    }
    best.1
}

/// The plane between two drones over one slot: `normal . p = centre + rate (t - from)`, with `half`
/// a gap on either side.
struct Bisector {
    normal: Vec3,
    centre: f64,
    rate: f64,
    half: f64,
    spare: f64,
}

impl Bisector {
    fn side_of(&self, first: bool, from: f64, source: Source) -> Side {
        let sign = if first { 1.0 } else { -1.0 };
        Side {
            source,
            normal: self.normal * sign,
            at: self.centre * sign + self.half,
            rate: self.rate * sign,
            from,
            spare: self.spare,
        }
    }
}

/// The moving plane that bisects the fleet-plan trajectories of drones `a` and `b`. It is made the
/// same way for both drones, so two replans that each keep `delta_min / 2` from it are apart.
fn bisector(a: &Trajectory, b: &Trajectory, from: f64, to: f64, limits: &Limits) -> Option<Bisector> {
    let (hull_a, hull_b) = (Hull::over(a, from, to), Hull::over(b, from, to));
    let gap_at = |t: f64| a.position(t) - b.position(t);
    let middle_at = |t: f64| 0.5 * (a.position(t) + b.position(t));
    let (first, last) = (gap_at(from), gap_at(to));
    let chord = last - first;
    let nearest = if chord.norm_squared() > 1e-12 {
        first + chord * (-first.dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0)
    } else {
        first
    };
    let mut best: Option<(f64, Bisector)> = None;
    for direction in [nearest, gap_at(0.5 * (from + to)), first, last] {
        let norm = direction.norm();
        if norm < 1e-6 {
            continue;
        }
        let normal = direction / norm;
        let rate = normal.dot(&(middle_at(to) - middle_at(from))) / (to - from);
        let start = normal.dot(&middle_at(from));
        let above = |t: f64, p: &Vec3| normal.dot(p) - start - rate * (t - from);
        let low = hull_a.least(above);
        let high = -hull_b.least(|t, p| -above(t, p));
        let gap = low - high;
        if best.as_ref().is_none_or(|(g, _)| gap > *g) {
            let half = 0.5 * gap.min(limits.delta_min);
            let centre = start + 0.5 * (low + high);
            best = Some((gap, Bisector { normal, centre, rate, half, spare: 0.5 * gap - half }));
        }
    }
    best.map(|(_, plane)| plane)
}

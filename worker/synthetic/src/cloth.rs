//! The true motion of a synthetic person's clothes, to compare with what a model learns.

use super::SyntheticPerson;
use super::build::Capsule;
use super::drape::Garment;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use yoto_capture::skeleton::transform::{
    add, apply, compose, cross, inverse, length, normalised, scale, sub,
};
use yoto_capture::skeleton::{Pose, Vec3};

/// Largest distance from a garment's surface with a defined offset, metres.
const MARGIN: f64 = 0.02;
/// Largest distance of a sampled point from the surface, metres.
const ON_SURFACE: f64 = 1e-4;
/// Iterations to find the canonical point of a point of the clothes, to a hundredth of a millimetre.
const ITERATIONS: usize = 60;
/// Most draws per sampled point, which ends the sampling of a person without moving clothes.
const DRAWS: usize = 200;

impl SyntheticPerson {
    /// The true non-rigid offset `Δx`, metres, at `canonical`, a point in the rest pose after inverse
    /// skinning. In `pose`, it has the shape and colour of the rest body at `canonical + Δx`. `None`
    /// farther than 2 cm outside the moving clothes.
    pub fn offset(&self, pose: &Pose, canonical: [f64; 3]) -> Option<[f64; 3]> {
        let fall = self.drape.posed(pose);
        [Garment::Hem, Garment::Sleeve]
            .into_iter()
            .filter(|garment| self.drape.has(*garment))
            .find_map(|garment| {
                let offset = fall.offset(garment, canonical);
                let there = add(canonical, offset);
                let distance = self
                    .capsules
                    .iter()
                    .filter(|capsule| capsule.part.garment() == Some(garment))
                    .map(|capsule| capsule.distance(there))
                    .fold(f64::INFINITY, f64::min);
                let covered = garment == Garment::Hem
                    || self.outfit.sleeve_covers(canonical)
                    || self.outfit.sleeve_covers(there);
                (distance < MARGIN && covered).then_some(offset)
            })
    }

    /// The canonical point `c` with `c + Δx(c) = rest`, metres: the result of inverse skinning in `pose`
    /// for the point of the clothes that is at `rest` in the rest pose. `None` away from the moving
    /// clothes.
    pub fn carried(&self, pose: &Pose, rest: [f64; 3]) -> Option<[f64; 3]> {
        let garment = self.cloth_at(rest)?.part.garment()?;
        let fall = self.drape.posed(pose);
        // The offset changes by less than the point, so this fixed-point iteration converges.
        let mut point = rest;
        for _ in 0..ITERATIONS {
            point = sub(rest, fall.offset(garment, point));
        }
        Some(point)
    }

    /// The position in `pose` of the point of the clothes that is at `rest` in the rest pose, metres.
    /// `None` away from the moving clothes.
    pub fn observed(&self, pose: &Pose, rest: [f64; 3]) -> Option<[f64; 3]> {
        let carried = self.carried(pose, rest)?;
        let joint = self.cloth_at(rest)?.joint;
        let still = Pose::rest(self.skeleton.joints());
        let [posed, at_rest] =
            [pose, &still].map(|pose| self.skeleton.world_transforms(pose)[joint]);
        Some(apply(&compose(&posed, &inverse(&at_rest)), carried))
    }

    /// Number of the parts that the moving clothes consist of. Each moves with one joint.
    pub fn cloth_parts(&self) -> usize {
        self.moving().count()
    }

    /// The place at rest of the point of the clothes' `part` that is at `point` of the world in `pose`, metres.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn traced(&self, pose: &Pose, part: usize, point: [f64; 3]) -> [f64; 3] {
        let capsule = self.moving().nth(part).expect("a part of the clothes");
        let still = Pose::rest(self.skeleton.joints());
        let [posed, at_rest] =
            [pose, &still].map(|pose| self.skeleton.world_transforms(pose)[capsule.joint]);
        let canonical = apply(&compose(&at_rest, &inverse(&posed)), point);
        let garment = capsule.part.garment().expect("moving clothes");
        add(canonical, self.drape.posed(pose).offset(garment, canonical))
    }

    /// The position of a point of moving clothes at `rest`, if skinning alone carried it: see [`Self::traced`].
    ///
    /// # Panics
    /// If there is no such part.
    pub fn still(&self, pose: &Pose, part: usize, rest: [f64; 3]) -> [f64; 3] {
        let capsule = self.moving().nth(part).expect("a part of the clothes");
        let garment = capsule.part.garment().expect("moving clothes");
        add(rest, self.drape.posed(pose).offset(garment, rest))
    }

    /// Distance of `rest`, a place in the rest pose, from the surface of the clothes' `part`, metres; infinite beyond the end
    /// of a sleeve.
    pub fn cloth_distance(&self, part: usize, rest: [f64; 3]) -> f64 {
        self.moving().nth(part).map_or(f64::INFINITY, |it| {
            let hem = it.part.garment() == Some(Garment::Hem);
            match hem || self.outfit.sleeve_covers(rest) {
                true => it.distance(rest),
                false => f64::INFINITY,
            }
        })
    }

    fn moving(&self) -> impl Iterator<Item = &Capsule> {
        (self.capsules.iter()).filter(|it| it.part.garment().is_some_and(|g| self.drape.has(g)))
    }

    /// The capsule of moving clothes with the surface nearest to `rest` in the rest pose; `None` away from
    /// the moving clothes.
    fn cloth_at(&self, rest: [f64; 3]) -> Option<&Capsule> {
        let still = Pose::rest(self.skeleton.joints());
        self.offset(&still, rest)?;
        self.capsules
            .iter()
            .filter(|capsule| capsule.part.garment().is_some_and(|g| self.drape.has(g)))
            .min_by(|a, b| a.distance(rest).total_cmp(&b.distance(rest)))
    }

    /// `count` points on the surface of the moving clothes in the rest pose, metres. The same seed gives the
    /// same points.
    pub fn cloth_points(&self, count: usize, seed: u64) -> Vec<[f64; 3]> {
        let cloth: Vec<_> = self
            .capsules
            .iter()
            .filter(|c| c.part.garment().is_some_and(|g| self.drape.has(g)))
            .collect();
        let rest = Pose::rest(self.skeleton.joints());
        let body = self.posed(&rest, &self.drape);
        let all: Vec<usize> = (0..self.capsules.len()).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut points = Vec::with_capacity(count);
        for _ in 0..count.saturating_mul(DRAWS) {
            if points.len() == count || cloth.is_empty() {
                break;
            }
            let capsule = cloth[rng.random_range(0..cloth.len())];
            let axis = sub(capsule.to, capsule.from);
            let share: f64 = rng.random();
            let radius = capsule.radii[0] + (capsule.radii[1] - capsule.radii[0]) * share;
            let normal = around(axis, rng.random_range(0.0..TAU));
            let on_axis = add(capsule.from, scale(axis, share));
            let mut point = add(on_axis, scale(normal, radius));
            // Blending moves the surface slightly outwards from each capsule.
            for _ in 0..8 {
                point = sub(point, scale(normal, body.distance(point, &all)));
            }
            let shows = body.distance(point, &all).abs() < ON_SURFACE
                && length(sub(point, on_axis)) < radius + MARGIN
                && self.offset(&rest, point).is_some();
            if shows {
                points.push(point);
            }
        }
        points
    }
}

/// The unit vector perpendicular to `axis` at an angle about it, radians.
fn around(axis: Vec3, angle: f64) -> Vec3 {
    let across = if axis[0].abs() > axis[1].abs() {
        [0.0, 1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    let first = normalised(cross(axis, across));
    let second = normalised(cross(axis, first));
    add(scale(first, angle.cos()), scale(second, angle.sin()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drape::Drape;
    use crate::raycast::{first_hit, render};

    fn still(person: &SyntheticPerson) -> Drape {
        Drape::new(&person.skeleton, 1.0, None, 0.0)
    }

    #[test]
    fn a_point_of_the_clothes_is_found_again_in_every_pose() {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let points = person.cloth_points(60, 3);
        let mut farthest = 0f64;
        for pose in person.unseen_motion(8) {
            for rest in &points {
                let carried = person.carried(&pose, *rest).expect("on the clothes");
                let offset = person.offset(&pose, carried).expect("on the clothes");
                let error = length(sub(add(carried, offset), *rest));
                assert!(error < 1e-4, "{error}");
                farthest = farthest.max(length(sub(carried, *rest)));
                let seen = person.observed(&pose, *rest).expect("on the clothes");
                let capsule = person.cloth_at(*rest).expect("on the clothes");
                let same = |other: &Capsule| std::ptr::eq(capsule, other);
                let own = [person.capsules.iter().position(same).expect("its own")];
                let depths = [
                    person.posed(&pose, &person.drape).distance(seen, &own),
                    person
                        .posed(&Pose::rest(24), &person.drape)
                        .distance(*rest, &own),
                ];
                assert!((depths[0] - depths[1]).abs() < 2e-3, "{depths:?} m");
            }
        }
        assert!(farthest > 0.02, "{farthest}: nothing moves");
    }

    #[test]
    fn a_point_of_a_part_is_traced_to_where_it_is_at_rest() {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let rest = Pose::rest(24);
        for pose in person.unseen_motion(4) {
            for point in person.cloth_points(40, 3) {
                let own = person.cloth_at(point).expect("on the clothes");
                let part = person.moving().position(|it| std::ptr::eq(it, own));
                let part = part.expect("its part");
                assert!(person.cloth_distance(part, point).abs() < MARGIN);
                let seen = person.observed(&pose, point).expect("on the clothes");
                let error = length(sub(person.traced(&pose, part, seen), point));
                assert!(error < 1e-4, "{error} m");
                assert_eq!(person.still(&rest, part, point), point);
            }
        }
    }

    #[test]
    fn frames_change_where_cloth_is_and_only_there() {
        const SIZE: u32 = 48;
        let camera = SyntheticPerson::train_camera(SIZE);
        for person in SyntheticPerson::cast(2, 7) {
            let still = still(&person);
            let rest = Pose::rest(24);
            let all: Vec<usize> = (0..person.capsules.len()).collect();
            let at_rest = [&person.drape, &still].map(|d| render(&person.posed(&rest, d), &camera));
            assert_eq!(at_rest[0], at_rest[1]);
            for pose in [
                person.motion(12).swap_remove(3),
                person.unseen_motion(16).swap_remove(10),
            ] {
                let bodies = [&person.drape, &still].map(|d| person.posed(&pose, d));
                let images = bodies.each_ref().map(|body| render(body, &camera));
                let mut changed = 0;
                for pixel in 0..(SIZE * SIZE) as usize {
                    let colours = images.each_ref().map(|image| &image.rgb[3 * pixel..][..3]);
                    // Rays near cloth take other steps, and hit the surface at slightly other points.
                    let apart = colours[0].iter().zip(colours[1]);
                    if apart.map(|(a, b)| a.abs_diff(*b)).max() <= Some(4) {
                        continue;
                    }
                    changed += 1;
                    let (row, column) = (pixel / SIZE as usize, pixel % SIZE as usize);
                    let near_cloth = bodies.iter().any(|body| {
                        (0..9).any(|sample| {
                            let shift = |i: usize| (i as f64 + 0.5) / 3.0;
                            let (u, v) = (column as f64, row as f64);
                            let (origin, direction) =
                                camera.ray(u + shift(sample % 3), v + shift(sample / 3));
                            first_hit(body, &all, origin, normalised(direction))
                                .is_some_and(|point| body.on_cloth(point, &all))
                        })
                    });
                    assert!(near_cloth, "{}: pixel {column}, {row}", person.name());
                }
                assert!(changed > 15, "{}: only {changed} pixels", person.name());
            }
        }
    }

    #[test]
    fn observed_cloth_is_the_rest_cloth_at_its_offset() {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let pose = person.unseen_motion(16).swap_remove(9);
        let body = person.posed(&pose, &person.drape);
        let at_rest = person.posed(&Pose::rest(24), &person.drape);
        let worlds = person.skeleton.world_transforms(&pose);
        let rests = person.skeleton.world_transforms(&Pose::rest(24));
        let (mut compared, mut farthest) = (0, 0.0f64);
        let points = person.cloth_points(300, 1);
        assert_eq!(points.len(), 300);
        for point in points {
            // The canonical point by the bones of each cloth capsule in turn.
            for (index, capsule) in person.capsules.iter().enumerate() {
                let cloth = capsule.part.garment().is_some();
                if !cloth || (at_rest.distance(point, &[index])).abs() > 1e-3 {
                    continue;
                }
                let canonical = person.carried(&pose, point).expect("on cloth");
                let offset = person.offset(&pose, canonical).expect("on cloth");
                assert!(
                    length(sub(add(canonical, offset), point)) < 1e-4,
                    "{point:?}"
                );
                farthest = farthest.max(length(sub(canonical, point)));
                let motion = compose(&worlds[capsule.joint], &inverse(&rests[capsule.joint]));
                let seen = apply(&motion, canonical);
                let distance = body.distance(seen, &[index]);
                assert!(distance.abs() < 2e-3, "{distance} m off {:?}", capsule.part);
                let colours = [body.colour(seen, &[index]), at_rest.colour(point, &[index])];
                assert!(length(sub(colours[0], colours[1])) < 1e-6);
                compared += 1;
            }
        }
        assert!(compared > 100, "{compared} points");
        assert!((0.08..0.25).contains(&farthest), "{farthest} m");
    }

    #[test]
    fn skin_and_air_have_no_offset() {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let pose = person.motion(12).swap_remove(3);
        for joint in ["head", "l_foot", "l_hand", "spine3"] {
            let names = &person.skeleton.names;
            let found = names.iter().position(|name| name == joint);
            let point = person.skeleton.rest[found.expect(joint)];
            assert_eq!(person.offset(&pose, point), None, "{joint}");
        }
        assert_eq!(person.offset(&pose, [0.0, 0.7, 0.6]), None);
    }
}

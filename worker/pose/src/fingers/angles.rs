//! Angles of fingers by the directions of their bones.
//!
//! Directions are in the axes of the hand: along straight fingers, away from its back, and towards the index finger. A finger bends by θ from the first axis against the second, and spreads by φ towards the third. Right hands mirror left ones, so
//! both have the same angles.

use yoto_capture::skeleton::fingers::RELAXED;
use yoto_capture::skeleton::transform::{
    Mat3, add, cross, dot, length, log_map, matmul, matvec, normalised, rodrigues,
    rotation_between, scale, sub, transpose,
};
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Numbers of a hand: θ and φ of the first joint and θ of the two others of index, middle, little and ring finger, then axis-angle
/// vectors of the thumb's three joints, radians.
pub(super) const NUMBERS: usize = 25;
pub(super) type Angles = [f64; NUMBERS];

/// A hand at rest, whose fingers are slightly bent.
pub(super) fn relaxed() -> Angles {
    let mut angles = [0.0; NUMBERS];
    for (own, [first, second, third]) in angles.chunks_exact_mut(4).zip(RELAXED) {
        own.copy_from_slice(&[first, 0.0, second, third]);
    }
    angles
}

/// Least and greatest θ and φ of the first joint, and θ of the second and the third one, radians.
const LIMITS: [[f64; 2]; 4] = [[-0.5, 1.6], [-0.4, 0.4], [-0.1, 1.9], [-0.1, 1.4]];
/// Cosine of θ from which φ counts in full.
const SPREAD_IS_TOLD: f64 = 0.3;
/// Largest rotation of each of the thumb's joints, radians.
const THUMB: [f64; 3] = [0.9, 0.9, 1.3];
/// First points of index, middle, little and ring finger and thumb among those of a hand's detector, in the skeleton's order.
const FIRST: [usize; 5] = [5, 9, 17, 13, 1];
/// Largest distance of the palm's points from a palm of the same size, as a share of its length: more is not a hand.
const NOT_A_HAND: f64 = 0.35;

/// One hand in the rest pose.
pub(super) struct HandShape {
    /// Columns: the hand's axes in the T-pose.
    axes: Mat3,
    /// From the wrist to the fingers' first joints, in the T-pose's axes.
    palm: [Vec3; 4],
    /// Unit vectors along the bones of each finger, in the hand's axes.
    bones: [[Vec3; 3]; 5],
}

impl HandShape {
    /// The hand of a side, 0 for left, of a skeleton with fingers; `None` if its joints are at one point or on one line.
    pub(super) fn of(skeleton: &Skeleton, side: usize) -> Option<Self> {
        let (wrist, first) = (20 + side, 24 + 15 * side);
        let rest = &skeleton.rest;
        let palm = [0, 1, 2, 3].map(|finger| sub(rest[first + 3 * finger], rest[wrist]));
        let fingers = [0, 1, 2, 3].map(|finger| {
            let at = first + 3 * finger;
            normalised(sub(rest[at + 1], rest[at]))
        });
        let axes = axes(&palm, &fingers, side)?;
        let into = transpose(&axes);
        let bones = [0, 1, 2, 3, 4].map(|finger| {
            let at = first + 3 * finger;
            let bone = |joint: usize| {
                let way = sub(rest[at + joint + 1], rest[at + joint]);
                normalised(matvec(&into, way))
            };
            // A finger's tip is no joint: the last bone goes on as the one before.
            [bone(0), bone(1), bone(1)]
        });
        let have_length = bones.as_flattened().iter().all(|it| length(*it) > 0.5);
        have_length.then_some(Self { axes, palm, bones })
    }

    /// The angles of a hand with these `points` of a detector, metres, in any axes; `None` if they are not those of a hand.
    pub(super) fn read(&self, points: &[Vec3; 21]) -> Option<Angles> {
        let seen = [5, 9, 17, 13].map(|point| sub(points[point], points[0]));
        let rotation = turned(&self.palm, &seen)?;
        // From the axes of the points to those of the hand.
        let into = matmul(&transpose(&self.axes), &transpose(&rotation));
        let mut angles = [0.0; NUMBERS];
        for (finger, first) in FIRST.into_iter().enumerate() {
            let ways = [0, 1, 2].map(|bone| sub(points[first + bone + 1], points[first + bone]));
            if ways.iter().any(|way| length(*way) < 1e-4) {
                return None;
            }
            let ways = ways.map(|way| normalised(matvec(&into, way)));
            let rest = &self.bones[finger];
            match finger {
                4 => angles[16..].copy_from_slice(thumb(rest, ways).as_flattened()),
                _ => angles[4 * finger..][..4].copy_from_slice(&bent(rest, ways)),
            }
        }
        Some(angles)
    }

    /// Rotations of the hand's fifteen joints, in the order of the skeleton.
    pub(super) fn rotations(&self, angles: &Angles) -> [Mat3; 15] {
        let of_body =
            |rotation: Mat3| matmul(&matmul(&self.axes, &rotation), &transpose(&self.axes));
        let mut rotations = [rodrigues([0.0; 3]); 15];
        for finger in 0..4 {
            let own = std::array::from_fn(|i| angles[4 * finger + i]);
            for (joint, rotation) in joints(&self.bones[finger], own).into_iter().enumerate() {
                rotations[3 * finger + joint] = of_body(rotation);
            }
        }
        for joint in 0..3 {
            let vector = std::array::from_fn(|i| angles[16 + 3 * joint + i]);
            rotations[12 + joint] = of_body(rodrigues(vector));
        }
        rotations
    }
}

/// The hand's axes as columns, by the fingers' first joints from the wrist and the directions of their first bones.
fn axes(palm: &[Vec3; 4], fingers: &[Vec3; 4], side: usize) -> Option<Mat3> {
    let [index, _, little, _] = *palm;
    let along = normalised(fingers.iter().fold([0.0; 3], |sum, it| add(sum, *it)));
    let across = sub(index, little);
    let across = normalised(sub(across, scale(along, dot(across, along))));
    let back = match side {
        0 => cross(across, along),
        _ => cross(along, across),
    };
    let is_flat = [along, back, across].iter().all(|it| length(*it) > 0.5);
    is_flat.then(|| std::array::from_fn(|row| [along[row], back[row], across[row]]))
}

/// The rotation that takes the palm at rest to the palm that is seen, in the sense of least squares; `None` if that is no palm.
fn turned(rest: &[Vec3; 4], seen: &[Vec3; 4]) -> Option<Mat3> {
    let size = |palm: &[Vec3; 4]| palm.iter().map(|it| dot(*it, *it)).sum::<f64>().sqrt();
    let (from, to) = (size(rest), size(seen));
    if from < 1e-6 || to < 1e-6 {
        return None;
    }
    let frame = |palm: &[Vec3; 4]| {
        let along = palm.iter().fold([0.0; 3], |sum, it| add(sum, *it));
        let across = sub(palm[0], palm[2]);
        let along = normalised(along);
        let across = normalised(sub(across, scale(along, dot(across, along))));
        let third = cross(along, across);
        let columns = [along, across, third];
        let is_flat = columns.iter().all(|it| length(*it) > 0.5);
        is_flat.then(|| -> Mat3 { std::array::from_fn(|row| columns.map(|it| it[row])) })
    };
    let rotation = matmul(&frame(seen)?, &transpose(&frame(rest)?));
    let off = rest.iter().zip(seen).map(|(rest, seen)| {
        let off = sub(scale(*seen, from / to), matvec(&rotation, *rest));
        dot(off, off)
    });
    (off.sum::<f64>().sqrt() <= NOT_A_HAND * from).then_some(rotation)
}

/// The rotation that bends by θ.
fn bend(angle: f64) -> Mat3 {
    let (sin, cos) = angle.sin_cos();
    [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]
}

/// The rotation that spreads by φ.
fn spread(angle: f64) -> Mat3 {
    let (sin, cos) = angle.sin_cos();
    [[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]]
}

/// θ and φ of a direction.
fn direction([along, back, across]: Vec3) -> [f64; 2] {
    let sign = if along < 0.0 { -1.0 } else { 1.0 };
    let spread = (sign * across).atan2(along.abs());
    [(-back).atan2(sign * along.hypot(across)), spread]
}

/// θ and φ of the first joint, and θ of the others, of a finger whose bones point these `ways`.
fn bent(rest: &[Vec3; 3], ways: [Vec3; 3]) -> [f64; 4] {
    let [[bend_at_rest, spread_at_rest], [bend_seen, spread_seen]] =
        [rest[0], ways[0]].map(direction);
    // A finger that is bent by a right angle points the same way however it spreads.
    let told = (bend_seen.cos().abs() / SPREAD_IS_TOLD).min(1.0);
    let limited = |angle: f64, at: usize| angle.clamp(LIMITS[at][0], LIMITS[at][1]);
    let mut own = [
        limited(bend_seen - bend_at_rest, 0),
        limited(told * (spread_seen - spread_at_rest), 1),
        0.0,
        0.0,
    ];
    for joint in 1..3 {
        // In the axes of the bone before, whose hinge is across the finger.
        let before =
            (joints(rest, own)[..joint].iter()).fold(bend(0.0), |sum, it| matmul(&sum, it));
        let hinge = transpose(&spread(spread_at_rest));
        let seen = matvec(&hinge, matvec(&transpose(&before), ways[joint]));
        let at_rest = matvec(&hinge, rest[joint]);
        let angle = |way: Vec3| (-way[1]).atan2(way[0]);
        let turn = angle(seen) - angle(at_rest);
        // A bone that points back is bent all the way, and not overstretched.
        let turn = if turn < -std::f64::consts::FRAC_PI_2 {
            turn + std::f64::consts::TAU
        } else {
            turn
        };
        own[joint + 1] = limited(turn, joint + 1);
    }
    own
}

/// Rotations of a finger's joints, in the hand's axes.
fn joints(rest: &[Vec3; 3], [first, across, second, third]: [f64; 4]) -> [Mat3; 3] {
    let [bend_at_rest, spread_at_rest] = direction(rest[0]);
    let at_rest = matmul(&spread(spread_at_rest), &bend(bend_at_rest));
    let turned = matmul(
        &spread(spread_at_rest + across),
        &bend(bend_at_rest + first),
    );
    let hinge = spread(spread_at_rest);
    let hinged = |angle: f64| matmul(&matmul(&hinge, &bend(angle)), &transpose(&hinge));
    [
        matmul(&turned, &transpose(&at_rest)),
        hinged(second),
        hinged(third),
    ]
}

/// Vectors of the thumb's joints, in the hand's axes, with which its bones point these `ways`.
fn thumb(rest: &[Vec3; 3], ways: [Vec3; 3]) -> [Vec3; 3] {
    let mut before = rodrigues([0.0; 3]);
    let mut vectors = [[0.0; 3]; 3];
    for joint in 0..3 {
        let seen = matvec(&transpose(&before), ways[joint]);
        let vector = rotation_between(rest[joint], seen).map_or([0.0; 3], |it| log_map(&it));
        let most = (THUMB[joint] / length(vector).max(1e-9)).min(1.0);
        vectors[joint] = scale(vector, most);
        before = matmul(&before, &rodrigues(vectors[joint]));
    }
    vectors
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::Pose;
    use yoto_capture::skeleton::fingers::with_fingers;
    use yoto_capture::skeleton::smpl::{AVERAGE_REST, JOINTS};

    fn person() -> Skeleton {
        let plain = Skeleton {
            names: JOINTS.map(|(name, _)| name.to_owned()).to_vec(),
            parents: JOINTS.map(|(_, parent)| parent).to_vec(),
            rest: AVERAGE_REST.to_vec(),
        };
        with_fingers(&plain).expect("SMPL's joints")
    }

    /// The points that a detector sees of a hand whose fingers have these angles, and whose arm is turned.
    fn points(skeleton: &Skeleton, side: usize, angles: &Angles) -> [Vec3; 21] {
        let shape = HandShape::of(skeleton, side).expect("a hand");
        let mut pose = Pose::rest(skeleton.joints());
        pose.rotations[18 + side] = [0.3, -0.8, 0.5];
        pose.rotations[20 + side] = [-0.4, 0.2, 0.9];
        let own = shape
            .rotations(angles)
            .map(|it| log_map(&it).map(|v| v as f32));
        pose.rotations[24 + 15 * side..][..15].copy_from_slice(&own);
        let transforms = skeleton.world_transforms(&pose);
        let at = |joint: usize| yoto_capture::skeleton::transform::position(&transforms[joint]);
        let mut points = [at(20 + side); 21];
        for (finger, first) in FIRST.into_iter().enumerate() {
            let joint = 24 + 15 * side + 3 * finger;
            for bone in 0..3 {
                points[first + bone] = at(joint + bone);
            }
            let bone = sub(skeleton.rest[joint + 2], skeleton.rest[joint + 1]);
            let way = yoto_capture::skeleton::transform::rotate(&transforms[joint + 2], bone);
            points[first + 3] = add(points[first + 2], way);
        }
        points
    }

    #[test]
    fn angles_come_back_from_the_points_of_both_hands() {
        let skeleton = person();
        let mut fist = relaxed();
        fist[..16].copy_from_slice(&[1.4, 0.0, 1.7, 1.0].repeat(4));
        fist[16..19].copy_from_slice(&[0.2, -0.3, 0.1]);
        let mut wide = [0.0; NUMBERS];
        for (finger, across) in [0.3, 0.05, -0.35, -0.15].into_iter().enumerate() {
            wide[4 * finger + 1] = across;
            wide[4 * finger] = -0.1 + 0.2 * finger as f64;
        }
        for side in 0..2 {
            let shape = HandShape::of(&skeleton, side).expect("a hand");
            for angles in [relaxed(), fist, wide] {
                let found = shape
                    .read(&points(&skeleton, side, &angles))
                    .expect("a hand");
                for (at, (found, wanted)) in found.iter().zip(&angles).enumerate().take(16) {
                    assert!(
                        (found - wanted).abs() < 0.02,
                        "side {side}, {at}: {found} {wanted}"
                    );
                }
                // A thumb's twist moves none of its points.
                let again = shape
                    .read(&points(&skeleton, side, &found))
                    .expect("a hand");
                for (found, again) in found.iter().zip(&again) {
                    assert!((found - again).abs() < 0.02);
                }
            }
        }
    }

    #[test]
    fn points_of_no_hand_are_refused_and_angles_are_limited() {
        let skeleton = person();
        let shape = HandShape::of(&skeleton, 0).expect("a hand");
        let mut points = points(&skeleton, 0, &relaxed());
        let bent_back = {
            let mut points = points;
            for tip in 6..9 {
                let off = sub(points[tip], points[5]);
                points[tip] = sub(points[5], off);
            }
            points
        };
        let angles = shape.read(&bent_back).expect("a hand");
        assert!(
            (0..4).all(|i| (LIMITS[i][0]..=LIMITS[i][1]).contains(&angles[i])),
            "{angles:?}"
        );
        points[17] = add(points[0], scale(sub(points[5], points[0]), 3.0));
        assert_eq!(shape.read(&points), None);
        assert_eq!(shape.read(&[[0.0; 3]; 21]), None);
    }
}

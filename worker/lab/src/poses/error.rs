//! Errors of fitted poses against exact ones.

use super::film::KnownFilm;
use anyhow::{Context, ensure};
use faer::Mat;
use serde::{Deserialize, Serialize};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::smpl::{self, WITH_FACE, WITH_FINGERS};
use yoto_capture::skeleton::transform::{
    Mat3, add, apply, dot, length, log_map, matmul, matvec, rodrigues, scale, sub, transpose,
};
use yoto_capture::skeleton::{Mat34, Skeleton, Vec3};
use yoto_proto::pose_track::PoseTrack;

/// Head, shoulders, elbows, wrists, hips, knees and ankles, of SMPL's joints.
const JOINTS: [usize; 13] = [15, 16, 17, 18, 19, 20, 21, 1, 2, 4, 5, 7, 8];
/// The bones between them, by their ends in SMPL's joints.
const BONES: [[usize; 2]; 8] = [
    [16, 18],
    [17, 19],
    [18, 20],
    [19, 21],
    [1, 4],
    [2, 5],
    [4, 7],
    [5, 8],
];
/// The places in [`JOINTS`] of the hips, whose middle is the root.
const HIPS: [usize; 2] = [7, 8];
/// The places in [`JOINTS`] of the wrists.
const WRISTS: [usize; 2] = [5, 6];
/// Joints of SMPL whose rotation is compared.
const HEAD: usize = 15;
const HANDS: [usize; 2] = [20, 21];
/// The other side of each of [`JOINTS`].
const OTHER: [usize; 13] = [0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11];
/// Error with left and right exchanged, as a share of the error as it is, below which they are mistaken.
const MISTAKEN: f64 = 0.5;

/// Errors of a film's fitted poses; means over frames. Roots are the same, and one scale per film brings the fitted body
/// to the size of the exact one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilmErrors {
    /// Who is filmed, doing what, from where.
    pub film: String,
    /// Frames in which the person was found.
    pub found: usize,
    /// All frames.
    pub frames: usize,
    /// Mean over 13 joints, millimetres.
    pub joints_mm: f64,
    /// The same across the line of sight.
    pub across_mm: f64,
    /// The same along the line of sight.
    pub depth_mm: f64,
    /// The same along the line of sight, of wrists.
    pub wrist_depth_mm: f64,
    /// Mean over 13 joints after each frame is rotated and scaled to the exact one, millimetres.
    pub aligned_mm: f64,
    /// Error of the rotation of wrists, degrees.
    pub wrist_degrees: f64,
    /// Error of the rotation of the head, degrees.
    pub head_degrees: f64,
    /// Error of the rotations of fingers' joints relative to the joints before, without thumbs, degrees; absent if fingers do not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finger_degrees: Option<f64>,
    /// Error of the jaw's and of the eyelids' angles, degrees; absent if faces do not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub face_degrees: Option<[f64; 2]>,
    /// Error of the lengths of arms' and legs' bones, as a share.
    pub bones: f64,
    /// Share of the frames in which left is taken for right.
    pub mistaken: f64,
}

/// A body in the camera's axes, metres.
struct Seen {
    joints: [Vec3; 13],
    head: Mat3,
    hands: [Mat3; 2],
    /// Rotations of the fingers' joints relative to those before; those of a hand at rest if the skeleton has no fingers.
    fingers: Vec<Mat3>,
    /// Angles of jaw, left and right eyelid, radians; 0 if the skeleton has no face.
    face: [f64; 3],
}

impl Seen {
    fn of(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Self {
        let transforms = skeleton.world_transforms(pose);
        let e: Mat34 = [camera.e[0], camera.e[1], camera.e[2]];
        let at = |joint: usize| {
            let m = transforms[joint];
            apply(&e, std::array::from_fn(|axis| m[axis][3]))
        };
        let turn = |joint: usize| matmul(&linear(&e), &linear(&transforms[joint]));
        let joints = JOINTS.map(at);
        let root = scale(add(joints[HIPS[0]], joints[HIPS[1]]), 0.5);
        Self {
            joints: joints.map(|joint| sub(joint, root)),
            head: turn(HEAD),
            hands: HANDS.map(turn),
            fingers: (smpl::JOINTS.len()..)
                .zip(smpl::FINGERS)
                .filter(|(_, (name, _))| !name.contains("thumb"))
                .map(|(joint, _)| {
                    let own = pose.rotations.get(joint).copied().unwrap_or_default();
                    rodrigues(own.map(f64::from))
                })
                .collect(),
            face: [WITH_FINGERS, WITH_FACE - 2, WITH_FACE - 1]
                .map(|joint| pose.rotations.get(joint).map_or(0.0, |it| f64::from(it[0]))),
        }
    }
}

fn linear(m: &Mat34) -> Mat3 {
    std::array::from_fn(|r| std::array::from_fn(|c| m[r][c]))
}

impl FilmErrors {
    /// The errors of `track`, whose frames' numbers are positions in the film `known`.
    pub(super) fn of(known: &KnownFilm, track: &PoseTrack) -> anyhow::Result<Self> {
        let skeleton = Skeleton::from_track(&track.skeleton).context("the fitted skeleton")?;
        let mut pairs = Vec::new();
        for frame in &track.frames {
            let exact = known.frames.get(frame.index as usize);
            let exact = exact.with_context(|| format!("frame {} was not filmed", frame.index))?;
            let camera = Camera::from_frame(frame, track.image_size)?;
            let fitted = Seen::of(&skeleton, &Pose::from_frame(frame)?, &camera);
            pairs.push((
                fitted,
                Seen::of(&known.skeleton, &exact.pose, &exact.camera),
            ));
        }
        ensure!(!pairs.is_empty(), "{}: nobody was found", known.name);
        let grown = size(
            pairs
                .iter()
                .map(|(fitted, exact)| (&fitted.joints, &exact.joints)),
        );
        let frames = pairs.len() as f64;
        let mean = |of: &dyn Fn(&Seen, &Seen) -> f64| {
            pairs
                .iter()
                .map(|(fitted, exact)| of(fitted, exact))
                .sum::<f64>()
                / frames
        };
        let off = |fitted: &Seen, exact: &Seen| -> [Vec3; 13] {
            std::array::from_fn(|i| sub(scale(fitted.joints[i], grown), exact.joints[i]))
        };
        let over_joints = |of: fn(Vec3) -> f64| {
            mean(&|fitted, exact| off(fitted, exact).map(of).iter().sum::<f64>() / 13.0)
        };
        Ok(Self {
            film: known.name.clone(),
            found: pairs.len(),
            frames: known.frames.len(),
            joints_mm: 1e3 * over_joints(length),
            across_mm: 1e3 * over_joints(|[x, y, _]| x.hypot(y)),
            depth_mm: 1e3 * over_joints(|[_, _, z]| z.abs()),
            wrist_depth_mm: 1e3
                * mean(&|fitted, exact| {
                    let off = off(fitted, exact);
                    WRISTS.map(|wrist| off[wrist][2].abs()).iter().sum::<f64>() / 2.0
                }),
            aligned_mm: 1e3 * mean(&|fitted, exact| aligned(&fitted.joints, &exact.joints)),
            wrist_degrees: mean(&|fitted, exact| {
                let pair = |side: usize| degrees(&fitted.hands[side], &exact.hands[side]);
                0.5 * (pair(0) + pair(1))
            }),
            head_degrees: mean(&|fitted, exact| degrees(&fitted.head, &exact.head)),
            finger_degrees: (known.skeleton.joints() >= WITH_FINGERS).then(|| {
                mean(&|fitted, exact| {
                    let pairs = fitted.fingers.iter().zip(&exact.fingers);
                    let sum: f64 = pairs.map(|(fitted, exact)| degrees(fitted, exact)).sum();
                    sum / exact.fingers.len() as f64
                })
            }),
            face_degrees: (known.skeleton.joints() == WITH_FACE).then(|| {
                let off = |i: usize| {
                    mean(&|fitted, exact| (fitted.face[i] - exact.face[i]).abs()).to_degrees()
                };
                [off(0), 0.5 * (off(1) + off(2))]
            }),
            bones: bones(&skeleton, &known.skeleton, grown),
            mistaken: mean(&|fitted, exact| {
                let error = |other: bool| {
                    (0..13)
                        .map(|i| {
                            let from = fitted.joints[if other { OTHER[i] } else { i }];
                            length(sub(scale(from, grown), exact.joints[i]))
                        })
                        .sum::<f64>()
                };
                f64::from(u8::from(error(true) < MISTAKEN * error(false)))
            }),
        })
    }
}

/// The factor that brings fitted joints nearest to the exact ones: Σ f·e / Σ f·f.
fn size<'a>(pairs: impl Iterator<Item = (&'a [Vec3; 13], &'a [Vec3; 13])>) -> f64 {
    let (mut both, mut own) = (0.0, 0.0);
    for (fitted, exact) in pairs {
        for (f, e) in fitted.iter().zip(exact) {
            both += dot(*f, *e);
            own += dot(*f, *f);
        }
    }
    both / own.max(1e-12)
}

/// The angle between two rotations, degrees.
fn degrees(a: &Mat3, b: &Mat3) -> f64 {
    length(log_map(&matmul(&transpose(a), b))).to_degrees()
}

/// The mean error of lengths of bones at rest, as a share.
fn bones(fitted: &Skeleton, exact: &Skeleton, grown: f64) -> f64 {
    let bone =
        |skeleton: &Skeleton, [a, b]: [usize; 2]| length(sub(skeleton.rest[a], skeleton.rest[b]));
    let off = BONES.map(|ends| (grown * bone(fitted, ends) / bone(exact, ends) - 1.0).abs());
    off.iter().sum::<f64>() / off.len() as f64
}

/// The mean distance of joints after the similarity that brings `from` nearest to `to` (Umeyama 1991).
fn aligned(from: &[Vec3; 13], to: &[Vec3; 13]) -> f64 {
    let middle =
        |points: &[Vec3; 13]| scale(points.iter().copied().fold([0.0; 3], add), 1.0 / 13.0);
    let (from_middle, to_middle) = (middle(from), middle(to));
    let from = from.map(|at| sub(at, from_middle));
    let to = to.map(|at| sub(at, to_middle));
    // Σ to fromᵀ = U S Vᵀ, R = U D Vᵀ with det R = 1.
    let covariance = Mat::<f64>::from_fn(3, 3, |r, c| (0..13).map(|i| to[i][r] * from[i][c]).sum());
    let Ok(svd) = covariance.svd() else {
        return f64::NAN;
    };
    let sign = (svd.U().determinant() * svd.V().determinant()).signum();
    let factors = [1.0, 1.0, sign];
    let rotation: Mat3 = std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            (0..3)
                .map(|k| svd.U()[(r, k)] * factors[k] * svd.V()[(c, k)])
                .sum()
        })
    });
    let own: f64 = from.iter().map(|at| dot(*at, *at)).sum();
    let grown = (0..13)
        .map(|i| dot(to[i], matvec(&rotation, from[i])))
        .sum::<f64>()
        / own.max(1e-12);
    let off = (0..13).map(|i| length(sub(scale(matvec(&rotation, from[i]), grown), to[i])));
    off.sum::<f64>() / 13.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::smpl::AVERAGE_REST;

    fn joints() -> [Vec3; 13] {
        JOINTS.map(|joint| AVERAGE_REST[joint])
    }

    #[test]
    fn a_similarity_leaves_no_aligned_error_and_a_mirror_does() {
        let turn = rodrigues([0.4, -1.1, 0.3]);
        let moved = joints().map(|at| add(scale(matvec(&turn, at), 1.3), [0.2, 0.1, 3.0]));
        assert!(aligned(&joints(), &moved) < 1e-9);
        let raised = moved.map(|at| [at[0], at[1], 2.0 * at[2]]);
        assert!(aligned(&joints(), &raised) > 0.01);
    }

    #[test]
    fn size_is_the_factor_between_bodies() {
        let grown = joints().map(|at| scale(at, 1.25));
        assert!((size([(&joints(), &grown)].into_iter()) - 1.25).abs() < 1e-12);
        assert!(
            (degrees(&rodrigues([0.0, 0.5, 0.0]), &rodrigues([0.0, 0.2, 0.0]))
                - 0.3f64.to_degrees())
            .abs()
                < 1e-9
        );
    }
}

//! Synthetic people as seen by a detector of key points.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{add, apply, length, scale, sub};
use yoto_capture::skeleton::{Pose, Skeleton, Vec3};
use yoto_pose::{Fitted, FrameKeyPoints, KeyPointSet, KeyPoints};
use yoto_proto::pose_track::Frame;
use yoto_synthetic::SyntheticPerson;

/// Errors of a detector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    /// Of points in pictures, as a share of the body's height, standard deviation.
    pub picture: f64,
    /// Of points in space, metres; none without a guess of depth.
    pub space: Option<f64>,
}

/// A clip with known joints.
#[derive(Clone, Debug)]
pub(crate) struct Clip {
    pub points: KeyPoints,
    /// `[frames][24]`, in the camera's axes, metres.
    pub joints: Vec<Vec<Vec3>>,
    pub focal: f64,
    pub height: f64,
}

/// Joint and offset of the points that are not joints on the true body: near the fit's first guess, but not
/// equal to it.
fn attachment(name: &str) -> (usize, Vec3) {
    match name {
        "nose" => (15, [0.0, 0.05, 0.13]),
        "eye_inner" => (15, [0.02, 0.09, 0.1]),
        "eye" => (15, [0.034, 0.09, 0.095]),
        "eye_outer" => (15, [0.047, 0.09, 0.085]),
        "ear" => (15, [0.08, 0.06, -0.005]),
        "mouth" => (15, [0.027, 0.015, 0.105]),
        "neck" => (12, [0.0, -0.045, 0.01]),
        "mid_hip" => (0, [0.0, -0.03, 0.0]),
        "shoulder" => (16, [0.005, -0.005, 0.0]),
        "elbow" => (18, [0.0, 0.0, -0.005]),
        "wrist" => (20, [0.005, 0.0, 0.0]),
        "pinky" => (20, [0.085, 0.0, -0.035]),
        "index" => (20, [0.095, 0.0, 0.02]),
        "thumb" => (20, [0.05, 0.0, 0.05]),
        "hip" => (1, [0.02, 0.03, 0.0]),
        "knee" => (4, [0.0, 0.0, 0.01]),
        "ankle" => (7, [0.005, 0.0, 0.0]),
        "heel" => (7, [0.0, -0.05, -0.045]),
        "foot_index" => (7, [0.01, -0.055, 0.175]),
        "big_toe" => (7, [-0.015, -0.055, 0.19]),
        "small_toe" => (7, [0.045, -0.055, 0.155]),
        other => unreachable!("no attachment for {other}"),
    }
}

/// A set's points: name and side (1 left, -1 right, 0 middle).
fn names(set: KeyPointSet) -> Vec<(&'static str, i32)> {
    let both = |names: &[&'static str]| -> Vec<(&'static str, i32)> {
        names
            .iter()
            .flat_map(|name| [(*name, 1), (*name, -1)])
            .collect()
    };
    let side = |names: &[&'static str], side: i32| -> Vec<(&'static str, i32)> {
        names.iter().map(|name| (*name, side)).collect()
    };
    let eyes = ["eye_inner", "eye", "eye_outer"];
    match set {
        KeyPointSet::BlazePose33 => [
            side(&["nose"], 0),
            side(&eyes, 1),
            side(&eyes, -1),
            both(&[
                "ear", "mouth", "shoulder", "elbow", "wrist", "pinky", "index", "thumb",
            ]),
            both(&["hip", "knee", "ankle", "heel", "foot_index"]),
        ]
        .concat(),
        KeyPointSet::Coco17Hands => [
            names(KeyPointSet::Coco17),
            both(&["pinky", "index", "thumb"]),
        ]
        .concat(),
        KeyPointSet::OpenPose25Hands => [
            names(KeyPointSet::OpenPose25),
            both(&["pinky", "index", "thumb"]),
        ]
        .concat(),
        KeyPointSet::Coco17 => [
            side(&["nose"], 0),
            both(&[
                "eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle",
            ]),
        ]
        .concat(),
        KeyPointSet::OpenPose25 => [
            side(&["nose", "neck"], 0),
            side(&["shoulder", "elbow", "wrist"], -1),
            side(&["shoulder", "elbow", "wrist"], 1),
            side(&["mid_hip"], 0),
            side(&["hip", "knee", "ankle"], -1),
            side(&["hip", "knee", "ankle"], 1),
            vec![("eye", -1), ("eye", 1), ("ear", -1), ("ear", 1)],
            side(&["big_toe", "small_toe", "heel"], 1),
            side(&["big_toe", "small_toe", "heel"], -1),
        ]
        .concat(),
        KeyPointSet::Joints24 => Vec::new(),
    }
}

/// A camera that looks at a standing person from 3.2 m, `down` degrees downwards.
pub(crate) fn camera(down: f64, size: [u32; 2], focal: f64) -> Camera {
    let target = [0.0, 0.95, 0.0];
    let (sine, cosine) = down.to_radians().sin_cos();
    let eye = [0.0, target[1] + 3.2 * sine, 3.2 * cosine];
    Camera::look_at(eye, target, [0.0, 1.0, 0.0], focal, size[0], size[1])
}

/// `poses` of `person` at 15 frames per second, as seen by a detector through `camera`.
pub(crate) fn clip(
    person: &SyntheticPerson,
    poses: &[Pose],
    camera: &Camera,
    set: KeyPointSet,
    errors: Errors,
    seed: u64,
) -> Clip {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let tall = skeleton.rest[15][1] + 0.19;
    let (focal, [cx, cy]) = (camera.k[0][0], [camera.k[0][2], camera.k[1][2]]);
    let pixels = errors.picture * tall * focal / 3.2;
    let see = |p: Vec3| -> Vec3 {
        std::array::from_fn(|i| {
            let row = camera.e[i];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]
        })
    };
    let mut frames = Vec::new();
    let mut joints = Vec::new();
    for (index, pose) in (0..).zip(poses) {
        let transforms = skeleton.world_transforms(pose);
        let truth: Vec<Vec3> = skeleton.posed_joints(pose).into_iter().map(see).collect();
        let mut points: Vec<Vec3> = names(set)
            .into_iter()
            .map(|(name, side)| {
                let (left, [x, y, z]) = attachment(name);
                let paired = !matches!(left, 0 | 12 | 15);
                let joint = left + usize::from(side < 0 && paired);
                let sign = if side < 0 { -1.0 } else { 1.0 };
                see(apply(&transforms[joint], [sign * x, y, z]))
            })
            .collect();
        if points.is_empty() {
            points.clone_from(&truth);
        }
        let hips = scale(add(truth[1], truth[2]), 0.5);
        frames.push(FrameKeyPoints {
            index,
            picture: points
                .iter()
                .map(|&[x, y, z]| {
                    let u = focal * x / z + cx + pixels * normal(&mut rng);
                    [u, focal * y / z + cy + pixels * normal(&mut rng), 0.9]
                })
                .collect(),
            space: errors.space.map_or_else(Vec::new, |error| {
                let noisy = |p: &Vec3| sub(*p, hips).map(|v| v + error * normal(&mut rng));
                points.iter().map(noisy).collect()
            }),
            ..FrameKeyPoints::default()
        });
        joints.push(truth);
    }
    Clip {
        points: KeyPoints {
            set,
            image_size: [camera.width, camera.height],
            fps: 15.0,
            frames,
        },
        joints,
        focal,
        height: tall,
    }
}

/// A normal number, by Box and Muller.
fn normal(rng: &mut impl Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Fitted joints in the camera's axes, `[frames][24]`, metres.
pub(crate) fn joints(fitted: &Fitted) -> Vec<Vec<Vec3>> {
    let skeleton = Skeleton::from_track(&fitted.track.skeleton).expect("a skeleton");
    let posed = |frame: &Frame| {
        let pose = Pose::from_frame(frame).expect("a pose");
        let see = |joint: Vec3| -> Vec3 {
            std::array::from_fn(|i| {
                let [x, y, z, by] = frame.e[i];
                x * joint[0] + y * joint[1] + z * joint[2] + by
            })
        };
        skeleton.posed_joints(&pose).into_iter().map(see).collect()
    };
    fitted.track.frames.iter().map(posed).collect()
}

/// Mean distance of joints from the truth, metres, after moving the pelvis of each frame to the origin and the
/// best rotation for the whole clip, without scaling.
pub(crate) fn error(found: &[Vec<Vec3>], truth: &[Vec<Vec3>]) -> f64 {
    let relative = |frames: &[Vec<Vec3>]| -> Vec<Vec3> {
        let by_pelvis = |frame: &Vec<Vec3>| -> Vec<Vec3> {
            frame.iter().map(|joint| sub(*joint, frame[0])).collect()
        };
        frames.iter().flat_map(by_pelvis).collect()
    };
    let (found, truth) = (relative(found), relative(truth));
    let turn = best_turn(&found, &truth);
    let off = |(a, b): (&Vec3, &Vec3)| {
        let turned: Vec3 = std::array::from_fn(|i| (0..3).map(|j| turn[i][j] * a[j]).sum());
        length(sub(turned, *b))
    };
    found.iter().zip(&truth).map(off).sum::<f64>() / found.len() as f64
}

/// The rotation that brings `found` nearest to `truth`, by Horn's quaternion method: the eigenvector of the
/// largest eigenvalue, by power iteration.
fn best_turn(found: &[Vec3], truth: &[Vec3]) -> [[f64; 3]; 3] {
    let mut s = [[0.0; 3]; 3];
    for (a, b) in found.iter().zip(truth) {
        for (i, row) in s.iter_mut().enumerate() {
            for (j, sum) in row.iter_mut().enumerate() {
                *sum += a[i] * b[j];
            }
        }
    }
    let n = [
        [
            s[0][0] + s[1][1] + s[2][2],
            s[1][2] - s[2][1],
            s[2][0] - s[0][2],
            s[0][1] - s[1][0],
        ],
        [
            s[1][2] - s[2][1],
            s[0][0] - s[1][1] - s[2][2],
            s[0][1] + s[1][0],
            s[2][0] + s[0][2],
        ],
        [
            s[2][0] - s[0][2],
            s[0][1] + s[1][0],
            s[1][1] - s[0][0] - s[2][2],
            s[1][2] + s[2][1],
        ],
        [
            s[0][1] - s[1][0],
            s[2][0] + s[0][2],
            s[1][2] + s[2][1],
            s[2][2] - s[0][0] - s[1][1],
        ],
    ];
    let shift = n.iter().flatten().map(|v: &f64| v.abs()).sum::<f64>();
    let mut q = [1.0, 0.1, 0.1, 0.1];
    for _ in 0..2000 {
        let next: [f64; 4] =
            std::array::from_fn(|i| shift * q[i] + (0..4).map(|j| n[i][j] * q[j]).sum::<f64>());
        let norm = next.iter().map(|v| v * v).sum::<f64>().sqrt();
        q = next.map(|v| v / norm);
    }
    let [w, x, y, z] = q;
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

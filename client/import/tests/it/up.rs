//! Which axis of a motion is up, in files that don't say: made-up people who stand or walk, in each axis.

use crate::{npz, pose_tools};
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::transform::{
    Mat3, Vec3, log_map, matmul, matvec, rodrigues, transpose,
};
use yoto_import::motion::{Motion, MotionOptions, Up, read};
use yoto_import::{TrackForm, write};
use yoto_proto::pose_track::FILE;

/// Frames of made-up motions.
const FRAMES: usize = 30;
/// Height of the pelvis above the floor, metres.
const PELVIS: f64 = 0.9;

/// Rotations from y up to each axis up, by the axis's name.
fn worlds() -> [(Up, Mat3); 6] {
    use std::f64::consts::{FRAC_PI_2, PI};
    [
        (Up::Y, [0.0; 3]),
        (Up::Z, [FRAC_PI_2, 0.0, 0.0]),
        (Up::MinusY, [PI, 0.0, 0.0]),
        (Up::MinusZ, [-FRAC_PI_2, 0.0, 0.0]),
        (Up::X, [0.0, 0.0, -FRAC_PI_2]),
        (Up::MinusX, [0.0, 0.0, FRAC_PI_2]),
    ]
    .map(|(up, turn)| (up, rodrigues(turn)))
}

/// A person who walks along z 8 cm per frame, y up: root and translation of each frame.
fn walk(world: &Mat3) -> (Vec<Vec3>, Vec<Vec3>) {
    let root = |frame: usize| {
        let turned = rodrigues([0.0, 0.02 * frame as f64, 0.0]);
        log_map(&matmul(world, &turned))
    };
    let place = |frame: usize| matvec(world, [0.0, PELVIS, 0.08 * frame as f64]);
    (
        (0..FRAMES).map(root).collect(),
        (0..FRAMES).map(place).collect(),
    )
}

/// Writes the walk in AMASS's manner, `width` numbers per pose, with more arrays.
fn amass(
    dir: &Path,
    name: &str,
    width: usize,
    world: &Mat3,
    more: &[(&str, &[usize], &[f64])],
) -> PathBuf {
    let (roots, places) = walk(world);
    let mut poses = vec![0.0; FRAMES * width];
    for (row, root) in poses.chunks_mut(width).zip(&roots) {
        row[..3].copy_from_slice(root);
        // The left knee bends by half a radian; joints after the body's must not move it.
        row[12] = 0.5;
        row[66..].fill(0.3);
    }
    let path = dir.join(name);
    let places = places.concat();
    let mut arrays: Vec<(&str, &[usize], &[f64])> = Vec::new();
    let (poses_shape, places_shape) = ([FRAMES, width], [FRAMES, 3]);
    arrays.push(("poses", &poses_shape, &poses));
    arrays.push(("trans", &places_shape, &places));
    arrays.extend(more);
    npz::write(&path, &arrays);
    path
}

/// The direction of the body of frame `at` in the motion, whose y is up: 1 if it stands.
fn stands(motion: &Motion, at: usize) -> f64 {
    matvec(&rodrigues(motion.frames[at].rotations[0]), [0.0, 1.0, 0.0])[1]
}

fn found(path: &Path) -> Motion {
    read(path, &MotionOptions::default())
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn a_walk_stands_up_whichever_axis_is_up() {
    let dir = tempfile::tempdir().expect("a folder");
    for (up, world) in worlds() {
        let path = amass(dir.path(), "walk.npz", 72, &world, &[]);
        let motion = found(&path);
        let notes = motion.notes.join("; ");
        assert!(notes.contains(&format!("{up} is up")), "{up}: {notes}");
        for at in 0..FRAMES {
            assert!(stands(&motion, at) > 0.999, "{up} frame {at}");
            assert!(
                (motion.frames[at].root[1] - PELVIS).abs() < 1e-5,
                "{up} frame {at}"
            );
        }
        let asked = MotionOptions {
            up: Some(up),
            ..MotionOptions::default()
        };
        assert_eq!(
            read(&path, &asked).expect("reads").frames,
            motion.frames,
            "{up}"
        );
    }
}

#[test]
fn smpl_x_and_smpl_h_are_read_with_or_without_rates() {
    let dir = tempfile::tempdir().expect("a folder");
    let (z_up, y_up) = (worlds()[1].1, worlds()[0].1);
    for (width, rate) in [
        (165, "mocap_frame_rate"),
        (147, "mocap_frame_rate"),
        (156, "mocap_framerate"),
    ] {
        let path = amass(
            dir.path(),
            "walk.npz",
            width,
            &z_up,
            &[(rate, &[], &[60.0])],
        );
        let motion = found(&path);
        assert_eq!((motion.frames.len(), motion.fps), (FRAMES, 60.0));
        assert!(stands(&motion, 3) > 0.999, "{width}");
        let knee = &motion.frames[3].rotations[4];
        assert!((knee[0] - 0.5).abs() < 1e-6, "{width}: {knee:?}");
        // SMPL's own hands move nothing, since these models replace them by fingers.
        let (hands, parts) = motion.frames[3].rotations[22..].split_at(2);
        assert_eq!(hands, [[0.0; 3]; 2], "{width}");
        let moved = [f64::from(0.3f32); 3];
        // SMPL-X has jaw and eyes besides, and no eyelids.
        let (fingers, face) = parts.split_at(if width == 147 { 0 } else { 30 });
        assert!(fingers.iter().all(|it| *it == moved), "{width}");
        let expected = match width {
            165 => vec![moved, moved, moved, [0.0; 3], [0.0; 3]],
            _ => Vec::new(),
        };
        assert_eq!(face, expected, "{width}");
        assert_eq!(motion.skeleton.names.len(), 24 + parts.len(), "{width}");
    }
    // Without a rate, SMPL-H's files have y up as often.
    let motion = found(&amass(dir.path(), "bare.npz", 156, &y_up, &[]));
    assert!(stands(&motion, 3) > 0.999, "{:?}", motion.notes);
    // AMASS's parts.
    let path = dir.path().join("parts.npz");
    let (roots, places) = walk(&z_up);
    let (roots, places) = (roots.concat(), places.concat());
    let body = vec![0.1; FRAMES * 63];
    npz::write(
        &path,
        &[
            ("root_orient", &[FRAMES, 3], &roots),
            ("pose_body", &[FRAMES, 63], &body),
            ("trans", &[FRAMES, 3], &places),
            ("mocap_frame_rate", &[], &[30.0]),
        ],
    );
    let motion = found(&path);
    assert_eq!(motion.frames[0].rotations[21], [0.1f32 as f64; 3]);
    for width in [63, 69, 64] {
        let path = dir.path().join("wrong.npz");
        let poses = vec![0.0; FRAMES * width];
        npz::write(
            &path,
            &[
                ("poses", &[FRAMES, width], &poses),
                ("trans", &[FRAMES, 3], &places),
            ],
        );
        let error = read(&path, &MotionOptions::default())
            .expect_err("refused")
            .to_string();
        assert!(
            error.contains(&format!("the shape is [30, {width}]")),
            "{error}"
        );
    }
}

#[test]
fn what_a_motion_does_not_tell_is_asked_for() {
    let dir = tempfile::tempdir().expect("a folder");
    // AMASS has z up, and this person is upright along -y, over no floor.
    let down = worlds()[2].1;
    let path = dir.path().join("still.npz");
    let root = log_map(&down);
    let poses: Vec<f64> = (0..FRAMES)
        .flat_map(|_| [root.to_vec(), vec![0.0; 69]].concat())
        .collect();
    let places = [0.0, 0.0, 3.0].repeat(FRAMES);
    npz::write(
        &path,
        &[
            ("poses", &[FRAMES, 72], &poses),
            ("trans", &[FRAMES, 3], &places),
            ("mocap_framerate", &[], &[30.0]),
        ],
    );
    let motion = found(&path);
    let notes = motion.notes.join("; ");
    assert!(
        notes.contains("z is up, as AMASS documents, although") && notes.contains("--up -y"),
        "{notes}"
    );
    // Half of the time each: a person who gets up, in axes that nobody documents.
    let half = FRAMES / 2;
    let lying = log_map(&matmul(&transpose(&worlds()[1].1), &worlds()[0].1));
    let poses: Vec<f64> = (0..FRAMES)
        .flat_map(|at| {
            let root = if at < half { [0.0; 3] } else { lying };
            [root.to_vec(), vec![0.0; 69]].concat()
        })
        .collect();
    npz::write(
        &path,
        &[
            ("poses", &[FRAMES, 72], &poses),
            ("trans", &[FRAMES, 3], &places),
        ],
    );
    let error = read(&path, &MotionOptions::default());
    let error = error.expect_err("refused").to_string();
    assert!(error.contains("does not tell which axis is up"), "{error}");
}

#[test]
fn a_capture_in_a_camera_s_axes_stands_up_as_a_motion() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = pose_tools::files("wham/output/demo/walk");
    let track = pose_tools::import(&pose_tools::options(dir.path(), poses));
    let out = dir.path().join("capture");
    write(&track, &out, TrackForm::Json, |_, _, _| {}).expect("writes");
    let motion = found(&out.join(FILE));
    let notes = motion.notes.join("; ");
    assert!(notes.contains("-y is up"), "{notes}");
    assert!(
        (0..motion.frames.len()).all(|at| stands(&motion, at) > 0.8),
        "{notes}"
    );
}

#[test]
fn frames_that_are_not_finite_are_left_out_and_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = amass(dir.path(), "walk.npz", 72, &worlds()[0].1, &[]);
    let whole = found(&path);
    let spoiled = dir.path().join("spoiled.npz");
    let spoil = |frames: usize| {
        npz::rewrite(&path, &spoiled, |name, array| {
            if name == "poses" {
                for frame in 0..frames {
                    array.values[72 * (7 + frame) + 3 * 5 + 1] = f64::NAN;
                }
            }
            if name == "trans" && frames > 1 {
                array.values[3 * 20] = f64::INFINITY;
            }
        });
        read(&spoiled, &MotionOptions::default())
    };
    let motion = spoil(1).expect("reads");
    let notes = motion.notes.join("; ");
    assert!(
        notes.contains("1 of 30 frames") && notes.contains("7 (rotation of r_knee)"),
        "{notes}"
    );
    assert_eq!(
        (motion.frames.len(), motion.fps),
        (whole.frames.len(), whole.fps)
    );
    let off = |at: usize| (motion.frames[at].root[2] - whole.frames[at].root[2]).abs();
    assert!(
        (0..FRAMES).all(|at| off(at) < 1e-5),
        "the motion takes its time"
    );
    let notes = spoil(2).expect("reads").notes.join("; ");
    assert!(notes.contains("20 (translation)"), "{notes}");
    let error = spoil(15).expect_err("many").to_string();
    assert!(
        error.contains("15 of 30 frames") && error.contains("r_knee"),
        "{error}"
    );
}

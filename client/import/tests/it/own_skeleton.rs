//! Captures that keep the tool's own tree of joints (`--keep-skeleton`).

use crate::npz::rewrite;
use crate::pose_tools::{files, options, truth};
use std::path::{Path, PathBuf};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{Mat3, matmul, transpose};
use yoto_formats::Array;
use yoto_import::{Format, Imported, Options, read};
use yoto_proto::pose_track;
use yoto_proto::smpl::JOINTS;

/// SMPL's joint in the place of each of the 22 of MHR that are kept, in their order.
const SMPL_JOINTS: [usize; 22] = [
    0, 1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, 14, 17, 19, 21, 13, 16, 18, 20, 12, 15,
];

fn keeping(poses: PathBuf) -> Options {
    Options {
        poses: Some(poses),
        fps: Some(25.0),
        keep_skeleton: true,
        ..Options::default()
    }
}

fn refused(options: &Options) -> String {
    let done = read(Format::AUTO, &files("clip/frames"), options);
    done.map(|found| found.notes)
        .expect_err("refused")
        .to_string()
}

/// The skeleton that the script moved.
pub(crate) fn smpl() -> pose_track::Skeleton {
    pose_track::Skeleton {
        names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        parents: JOINTS
            .iter()
            .map(|(_, above)| above.map_or(-1, |above| above as i32))
            .collect(),
        rest_joints: truth().rest_joints,
    }
}

/// SAM 3D Body's files, changed.
fn changed(dir: &Path, change: impl Fn(&str, &mut Array)) -> PathBuf {
    let folder = dir.join("changed");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    for entry in std::fs::read_dir(files("sam_3d_body")).expect("a folder") {
        let from = entry.expect("an entry").path();
        let name = from.file_name().expect("a name");
        rewrite(&from, &folder.join(name), &change);
    }
    folder
}

fn rotations(skeleton: &Skeleton, pose: &[f64]) -> Vec<Mat3> {
    let global = skeleton.global_transforms(pose.as_chunks::<3>().0);
    let rotation = |it: &[[f64; 4]; 3]| it.map(|row| [row[0], row[1], row[2]]);
    global.iter().map(rotation).collect()
}

/// Joints land where the script has them, and turn from frame to frame as the script's do.
fn lands(found: &Imported) {
    let truth = truth();
    let body = &truth.people[0];
    let notes = found.notes.join("\n");
    let skeleton = Skeleton::from_track(&found.track.skeleton).expect("a skeleton");
    let original = Skeleton::from_track(&smpl()).expect("a skeleton");
    let mut before: Option<(Vec<Mat3>, Vec<Mat3>)> = None;
    for frame in &found.track.frames {
        let at = frame.index as usize;
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, found.track.image_size).expect("a camera");
        for (joint, index) in skeleton.posed_joints(&pose).iter().zip(SMPL_JOINTS) {
            let seen = camera.project(*joint).expect("in front of the camera");
            let [u, v] = body.pixels[at][index];
            let off = (seen[0] - 0.5 - u).hypot(seen[1] - 0.5 - v);
            assert!(off < 0.3, "frame {at} joint {index}: {off} px; {notes}");
        }
        let (own, wanted) = (
            rotations(&skeleton, &frame.pose),
            rotations(&original, &body.poses[at]),
        );
        if let Some((own_before, wanted_before)) = &before {
            for (joint, index) in SMPL_JOINTS.iter().enumerate() {
                let moved = matmul(&own[joint], &transpose(&own_before[joint]));
                let meant = matmul(&wanted[*index], &transpose(&wanted_before[*index]));
                let off = moved.as_flattened().iter().zip(meant.as_flattened());
                let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 2e-3, "frame {at} joint {index}: {off}");
            }
        }
        before = Some((own, wanted));
    }
}

#[test]
fn mhr_s_joints_are_kept_with_their_places_and_turns() {
    let found = read(
        Format::AUTO,
        &files("clip/frames"),
        &keeping(files("sam_3d_body")),
    );
    let found = found.expect("imports");
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("the skeleton is the tool's own: 22 joints")
            && notes.contains("the body agrees with the masks to"),
        "{notes}"
    );
    let skeleton = &found.track.skeleton;
    assert_eq!((skeleton.names.len(), &*skeleton.names[0]), (22, "root"));
    assert_eq!(found.track.frames.len(), 16);
    lands(&found);
    // At rest somebody stands with y up and the arms in a T, facing +z.
    let rest = |name: &str| {
        let at = skeleton.names.iter().position(|it| it == name);
        skeleton.rest_joints[at.expect(name)]
    };
    let bone = |from: &str, to: &str| {
        let (from, to) = (rest(from), rest(to));
        std::array::from_fn::<f64, 3, _>(|i| to[i] - from[i])
    };
    for (from, to, axis, sign) in [
        ("l_uparm", "l_lowarm", 0, 1.0),
        ("r_lowarm", "r_wrist", 0, -1.0),
        ("l_upleg", "l_lowleg", 1, -1.0),
        ("root", "c_neck", 1, 1.0),
    ] {
        let bone = bone(from, to);
        let length = bone.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!(bone[axis] * sign > 0.98 * length, "{from}: {bone:?}");
    }
    assert!(bone("l_foot", "l_ball")[2] > 0.0, "toes point ahead");

    let longer = Options {
        focal: Some(2.0 * found.track.frames[0].k[0][0]),
        ..keeping(files("sam_3d_body"))
    };
    let longer = read(Format::AUTO, &files("clip/frames"), &longer).expect("imports");
    let depth =
        |found: &Imported| skeleton.rest_joints[0][2] + found.track.frames[3].translation[2];
    assert!((depth(&longer) / depth(&found) - 2.0).abs() < 1e-6);
}

#[test]
fn rotations_in_the_camera_s_axes_are_found_and_others_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    // A fork that turns the rotations as well as the positions.
    let turned = changed(dir.path(), |name, array| {
        if name == "pred_global_rots" {
            for rotation in array.values.as_chunks_mut::<9>().0 {
                rotation[3..].iter_mut().for_each(|v| *v = -*v);
            }
        }
    });
    let found = read(Format::AUTO, &files("clip/frames"), &keeping(turned)).expect("imports");
    let notes = found.notes.join("\n");
    assert!(notes.contains("in the camera's axes already"), "{notes}");
    lands(&found);

    // From the camera's axes, in place of to them.
    let transposed = changed(dir.path(), |name, array| {
        if name == "pred_global_rots" {
            for rotation in array.values.as_chunks_mut::<9>().0 {
                for (i, j) in [(1, 3), (2, 6), (5, 7)] {
                    rotation.swap(i, j);
                }
            }
        }
    });
    let text = refused(&keeping(transposed));
    assert!(text.contains("do not belong together"), "{text}");
    let stretched = changed(dir.path(), |name, array| {
        if name == "pred_global_rots" {
            array.values.iter_mut().for_each(|v| *v *= 1.1);
        }
    });
    let text = refused(&keeping(stretched));
    assert!(text.contains("joint 1 is not a rotation"), "{text}");
    let without = changed(dir.path(), |name, array| {
        if name == "pred_global_rots" {
            array.values.clear();
        }
    });
    let text = refused(&keeping(without.clone()));
    assert!(
        text.contains("has no rotations (pred_global_rots)"),
        "{text}"
    );
    let fitted = Options {
        keep_skeleton: false,
        ..keeping(without)
    };
    let found = read(Format::AUTO, &files("clip/frames"), &fitted).expect("imports");
    assert_eq!(found.track.skeleton.names.len(), 24);
}

#[test]
fn what_has_no_tree_of_its_own_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = refused(&keeping(files("openpose")));
    assert!(
        text.contains("OpenPose writes points, which have no tree of joints to keep"),
        "{text}"
    );
    let text = refused(&keeping(files("mediapipe/landmarks.npz")));
    assert!(text.contains("MediaPipe writes points"), "{text}");
    for path in [
        "wham/output/demo/walk",
        "gvhmr/outputs/demo/walk/hmr4d_results.pt",
    ] {
        let text = refused(&Options {
            keep_skeleton: true,
            ..options(dir.path(), files(path))
        });
        assert!(
            text.contains("--keep-skeleton") && text.contains("SMPL's own, or SMPL-X's"),
            "{path}: {text}"
        );
    }
    let tall = Options {
        height: Some(1.8),
        ..keeping(files("sam_3d_body"))
    };
    let text = refused(&tall);
    assert!(text.contains("has its own size"), "{text}");
}

//! Every format's joints land where they should.

use crate::projected::assert_lands;
use crate::{captures, expected, format};
use yoto_import::{BodyModel, Options, Pictures, read};

fn smpl() -> Options {
    Options {
        body_model: Some(captures("smpl/model.npz")),
        ..Options::default()
    }
}

/// Shapes differ from frame to frame while a capture has one skeleton: limbs are as long as those
/// of the mean shape, which moves joints by a few pixels; the root is exact.
const SHAPES_DIFFER: f64 = 4.0;

fn root_is_exact(track: &yoto_proto::pose_track::PoseTrack, name: &str) {
    let expected = expected(name);
    for frame in &track.frames {
        let root: [f64; 3] =
            std::array::from_fn(|i| track.skeleton.rest_joints[0][i] + frame.translation[i]);
        let seen: [f64; 3] = std::array::from_fn(|i| {
            let row = frame.e[i];
            row[0] * root[0] + row[1] * root[1] + row[2] * root[2] + row[3]
        });
        let pixel = |i: usize| frame.k[i][i] * seen[i] / seen[2] + frame.k[i][2] - 0.5;
        let wanted = &expected["frames"][frame.index as usize][0];
        for axis in 0..2 {
            let off = (pixel(axis) - wanted[axis].as_f64().expect("a number")).abs();
            assert!(off < 1e-3, "{name} frame {}: {off} px", frame.index);
        }
    }
}

#[test]
fn body_models_of_every_kind_give_the_same_joints() {
    let expected = expected("smpl");
    let betas: Vec<f64> = serde_json::from_value(expected["betas"].clone()).expect("betas");
    let wanted: Vec<[f64; 3]> = serde_json::from_value(expected["joints"].clone()).expect("joints");
    for name in [
        "smpl/model.npz",
        "smpl/model-python2-0.pkl",
        "smpl/model-python2-2.pkl",
        "smpl/model-python3.pkl",
    ] {
        let model = BodyModel::open(&captures(name)).expect(name);
        for (found, wanted) in model.joints(&betas).iter().zip(&wanted) {
            for axis in 0..3 {
                assert!((found[axis] - wanted[axis]).abs() < 1e-6, "{name}");
            }
        }
    }
}

#[test]
fn zju_is_in_millimetres_and_turns_about_the_origin() {
    for name in ["CoreView_377", "CoreView_313"] {
        let found = read(format("zju"), &captures(name), &smpl()).expect(name);
        assert_lands(&found.track, name, &[0, 1, 2], SHAPES_DIFFER);
        root_is_exact(&found.track, name);
        let other = Options {
            camera: Some(1),
            frames: Some((1, 3, 1)),
            ..smpl()
        };
        let found = read(format("zju"), &captures(name), &other).expect(name);
        assert_lands(&found.track, &format!("{name}@1"), &[1, 2], SHAPES_DIFFER);
        let Pictures::Files(files) = &found.pictures else {
            panic!("{name} has files");
        };
        assert!(files[0].image.is_file() && files[0].masks.len() == 2);
        assert!(!found.notes.iter().any(|note| note.contains("range")));
        let beyond = Options {
            frames: Some((1, 900, 2)),
            ..smpl()
        };
        let found = read(format("zju"), &captures(name), &beyond).expect(name);
        let told = "the range goes to frame 900, and there are 3 frames";
        assert!(found.notes.iter().any(|it| it == told), "{:?}", found.notes);
    }
}

#[test]
fn humannerf_s_wild_video_and_what_it_prepares_are_the_same() {
    let wild = read(format("humannerf"), &captures("humannerf_wild"), &smpl()).expect("wild");
    assert_lands(&wild.track, "humannerf_wild", &[0, 1], SHAPES_DIFFER);
    root_is_exact(&wild.track, "humannerf_wild");
    // Its rest joints are in the files: no body model is needed.
    let folder = captures("humannerf_wild_prepared");
    let made = read(format("humannerf"), &folder, &Options::default()).expect("prepared");
    assert_lands(
        &made.track,
        "humannerf_wild_prepared",
        &[0, 1],
        SHAPES_DIFFER,
    );
    root_is_exact(&made.track, "humannerf_wild_prepared");
    for (a, b) in wild.track.frames.iter().zip(&made.track.frames) {
        for axis in 0..3 {
            assert!((a.translation[axis] - b.translation[axis]).abs() < 1e-5);
        }
        let same = a
            .pose
            .iter()
            .zip(&b.pose)
            .all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(same, "{:?} {:?}", a.pose, b.pose);
    }
    let joints = Options {
        rest_joints: Some(folder.join("canonical_joints.pkl")),
        ..Options::default()
    };
    let given = read(format("humannerf"), &captures("humannerf_wild"), &joints).expect("given");
    assert_eq!(given.track.skeleton, made.track.skeleton);
}

#[test]
fn humannerf_s_prepared_zju_keeps_its_lens() {
    let name = "humannerf_zju_prepared";
    let found = read(format("humannerf"), &captures(name), &Options::default()).expect(name);
    assert_lands(&found.track, name, &[0, 1], SHAPES_DIFFER);
    root_is_exact(&found.track, name);
}

#[cfg(feature = "hdf5")]
#[test]
fn people_snapshot_is_exact() {
    let name = "people_snapshot/x-1-test";
    let found = read(format("people-snapshot"), &captures(name), &smpl()).expect(name);
    assert_lands(&found.track, name, &[0, 1, 2, 3], 1e-3);
    let name = "people_snapshot/x-2-film";
    let found = read(format("people-snapshot"), &captures(name), &smpl()).expect(name);
    assert_lands(&found.track, name, &[0, 1, 2, 3], 1e-3);
    assert!(matches!(&found.pictures, Pictures::Video { masks, .. } if masks.len() == 4));
}

#[test]
fn instant_avatar_is_exact() {
    let name = "instant_avatar";
    let found = read(format("instant-avatar"), &captures(name), &smpl()).expect(name);
    assert_lands(&found.track, name, &[0, 1, 2, 3], 1e-3);
    let split = Options {
        poses: Some("poses/train.npz".into()),
        frames: Some((0, 4, 2)),
        ..smpl()
    };
    let found = read(format("instant-avatar"), &captures(name), &split).expect("a split");
    assert_lands(&found.track, name, &[0, 2], 1e-3);
}

//! The uploaded files of a capture, and faults found before the upload.

use super::*;
use yoto_proto::correction::Unit;
use yoto_proto::media_plan::Timing;
use yoto_proto::pose_track::{Frame, PoseTrack, Skeleton};

fn write_capture(dir: &Path, below: &str, break_it: fn(&mut PoseTrack)) {
    let identity = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
    let frame = |index| Frame {
        index,
        pose: vec![0.0; 3],
        translation: [0.0; 3],
        k: [[9.0, 0.0, 4.0], [0.0, 9.0, 4.0], [0.0, 0.0, 1.0]],
        e: std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j))),
    };
    let skeleton = Skeleton {
        names: vec!["root".into()],
        parents: vec![-1],
        rest_joints: vec![[0.0; 3]],
    };
    let mut track = PoseTrack {
        skeleton,
        image_size: [8, 8],
        fps: 15.0,
        distortion: [0.0; 5],
        frames: vec![frame(0), frame(7)],
    };
    break_it(&mut track);
    std::fs::write(
        dir.join(FILE),
        serde_json::to_vec(&track).expect("serialises"),
    )
    .expect("writes");
    for folder in ["frames", "masks"] {
        let folder = dir.join(below).join(folder);
        std::fs::create_dir_all(&folder).expect("creates");
        for index in [0, 7] {
            std::fs::write(folder.join(format!("{index:06}.png")), b"12345").expect("writes");
        }
    }
}

#[test]
fn both_layouts_upload_the_same_paths() {
    for below in ["", "train"] {
        let dir = tempfile::tempdir().expect("temporary folder");
        write_capture(dir.path(), below, |_| {});
        let capture = CaptureDir::open(dir.path()).expect("a good capture");
        let paths: Vec<&str> = capture
            .files
            .iter()
            .map(|file| file.path.as_str())
            .collect();
        let expected = [
            "frames/000000.png",
            "masks/000000.png",
            "frames/000007.png",
            "masks/000007.png",
            "poses.json",
        ];
        assert_eq!(paths, expected, "in {below:?}");
        let json = std::fs::metadata(dir.path().join(FILE))
            .expect("exists")
            .len();
        assert_eq!(capture.bytes, json + 4 * 5);
    }
}

#[test]
fn a_video_or_an_archive_goes_up_as_it_is() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "train", |_| {});
    std::fs::write(dir.path().join("train/video.mp4"), b"film").expect("writes");
    let paths = |capture: &CaptureDir| -> Vec<String> {
        capture.files.iter().map(|file| file.path.clone()).collect()
    };
    let images = CaptureDir::open(dir.path()).expect("a good capture");
    assert_eq!(paths(&images).len(), 5, "pictures, unless asked otherwise");
    assert!(
        images.notes[0].contains("--frames video"),
        "{:?}",
        images.notes
    );

    let mut options = CaptureOptions {
        prefer: Some(Prefer::Video),
        ..CaptureOptions::default()
    };
    options.selection.end = Some(7);
    let video = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
    let expected = ["video.mp4", "masks/000000.png", "media.json", "poses.json"];
    assert_eq!(paths(&video), expected);

    std::fs::remove_dir_all(dir.path().join("train/frames")).expect("removes");
    std::fs::remove_dir_all(dir.path().join("train/masks")).expect("removes");
    std::fs::write(dir.path().join("train/masks.tar"), b"tar").expect("writes");
    let film = CaptureDir::open(dir.path()).expect("a good capture");
    assert_eq!(paths(&film), ["video.mp4", "masks.tar", "poses.json"]);

    let whole = dir.path().join("ada.tar.gz");
    std::fs::write(&whole, b"\x1f\x8bpacked").expect("writes");
    let packed = CaptureDir::open(&whole).expect("not looked into");
    assert_eq!(
        (paths(&packed), packed.bytes),
        (vec!["capture.tar.gz".to_owned()], 8)
    );
    std::fs::write(&whole, b"packed").expect("writes");
    let error = CaptureDir::open(&whole).expect_err("is no archive");
    assert!(error.to_string().contains("is not an archive"), "{error}");
    let film = dir.path().join("Walk.MOV");
    std::fs::write(&film, b"film").expect("writes");
    let alone = CaptureDir::open(&film).expect("a film alone");
    assert_eq!(
        (paths(&alone), alone.bytes),
        (vec!["video.mov".to_owned()], 4)
    );
    let options = CaptureOptions {
        timing: Timing::Time,
        ..CaptureOptions::default()
    };
    let error = CaptureDir::open_with(&film, &options).expect_err("there are no poses to match");
    assert!(error.to_string().contains("yoto import"), "{error}");
}

#[test]
fn pictures_of_any_name_are_found_by_their_number() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |_| {});
    let frames = dir.path().join("frames");
    std::fs::rename(frames.join("000007.png"), frames.join("shot 7.JPG")).expect("renames");
    let capture = CaptureDir::open(dir.path()).expect("a good capture");
    let uploaded = |name: &str| capture.files.iter().any(|file| file.path == name);
    assert!(uploaded("frames/000007.jpg"), "{:?}", capture.files);
    std::fs::copy(frames.join("shot 7.JPG"), frames.join("7.png")).expect("copies");
    let error = CaptureDir::open(dir.path())
        .expect_err("two of a kind")
        .to_string();
    assert!(
        error.contains("frame 7") && error.contains("shot 7.JPG"),
        "{error}"
    );
}

#[test]
fn a_correction_goes_up_beside_the_files_as_they_are() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |track| {
        track.frames[0].translation[2] = 3000.0;
        track.frames[1].translation[2] = 20_000.0;
    });
    assert!(CaptureDir::open(dir.path()).is_err(), "20 km away");
    let mut options = CaptureOptions::default();
    options.correction.units.root = Unit::Millimetre;
    options.correction.mask_shift = 1;
    let capture = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
    let paths: Vec<&str> = capture.files.iter().map(|it| it.path.as_str()).collect();
    let expected = [
        "frames/000000.png",
        "masks/000007.png",
        "media.json",
        "poses.json",
    ];
    assert_eq!(paths, expected);
    let planned = capture.planned.expect("a folder has one");
    assert_eq!(planned.track.frames[0].translation[2], 3.0);
    let in_memory = |path: &str| {
        let file = capture.files.iter().find(|it| it.path == path);
        match file.map(|it| &it.source) {
            Some(FileSource::Memory(bytes)) => bytes.clone(),
            other => panic!("{path}: {other:?}"),
        }
    };
    let plan: MediaPlan = serde_json::from_slice(&in_memory("media.json")).expect("reads");
    assert_eq!(plan.correction, options.correction);
    assert_eq!(
        plan.track("poses.json", &in_memory("poses.json")),
        Ok(planned),
        "the job reads the same"
    );
}

#[test]
fn the_model_reads_the_same_files() {
    use std::collections::BTreeSet;
    use yoto_capture::CaptureFolder;
    let dir = tempfile::tempdir().expect("temporary folder");
    // A folder with both layouts, as one that was unpacked over another.
    for below in ["", "train"] {
        write_capture(dir.path(), below, |_| {});
        let capture = CaptureDir::open(dir.path()).expect("a good capture");
        let ours: BTreeSet<_> = capture
            .files
            .into_iter()
            .map(|file| {
                let disk = match file.source {
                    FileSource::Disk(path) => path,
                    FileSource::Memory(_) => dir.path().join(FILE),
                };
                (file.path, disk)
            })
            .collect();
        let folder = CaptureFolder::open(dir.path()).expect("a good capture");
        let theirs = folder.files().into_iter().map(|it| (it.relative, it.path));
        assert_eq!(ours, theirs.collect(), "after {below:?}");
    }
}

#[test]
fn a_missing_mask_and_a_bad_pose_are_named() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |_| {});
    std::fs::remove_file(dir.path().join("masks/000007.png")).expect("removes");
    let error = CaptureDir::open(dir.path())
        .expect_err("a mask is missing")
        .to_string();
    assert!(
        error.contains("masks/000007.png frame 7: there is no such file"),
        "{error}"
    );

    write_capture(dir.path(), "", |track| track.frames[1].pose[2] = 1e9);
    let error = CaptureDir::open(dir.path())
        .expect_err("a pose is out of range")
        .to_string();
    assert!(error.contains("poses.json frame 7: pose[2]"), "{error}");
}

/// The media tests' film of 20 frames at `to`.
fn film(to: &Path) {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"));
    let clip = here.join("../../worker/media/tests/clips/b_frames.mp4");
    std::fs::copy(clip, to).expect("copies");
}

#[test]
fn poses_beyond_the_films_end_are_told_before_the_upload() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |track| {
        let frame = track.frames[0].clone();
        let at = |index| Frame {
            index,
            ..frame.clone()
        };
        track.frames = [0, 7, 20].map(at).to_vec();
    });
    std::fs::remove_dir_all(dir.path().join("frames")).expect("removes");
    film(&dir.path().join("video.mp4"));
    let capture = CaptureDir::open(dir.path()).expect("frame 20 has no mask, and needs none");
    assert_eq!(capture.frames(), 2);
    let told = "video.mp4 has 20 frames: the pose of frame 20 is left out".to_owned();
    assert!(capture.notes.contains(&told), "{:?}", capture.notes);

    write_capture(dir.path(), "", |track| track.frames[1].index = 40);
    std::fs::remove_dir_all(dir.path().join("frames")).expect("removes");
    let error = CaptureDir::open(dir.path()).expect_err("far beyond");
    let expected = "video.mp4 frame 40: the pose track has this frame, but the video has only 20, \
                    0 to 19: 1 of 2 poses are beyond its end";
    assert!(error.to_string().contains(expected), "{error}");
}

#[test]
fn a_range_beyond_the_clip_is_told() {
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |_| {});
    let mut options = CaptureOptions::default();
    options.selection.end = Some(8);
    let whole = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
    assert!(!whole.notes.iter().any(|note| note.contains("asked for")));
    options.selection.end = Some(900);
    let cut = CaptureDir::open_with(dir.path(), &options).expect("a good capture");
    let told = "frames up to 900 are asked for, but the last pose is of frame 7: frames end there";
    assert!(cut.notes.iter().any(|note| note == told), "{:?}", cut.notes);
}

#[test]
fn joints_of_smpls_tree_get_its_names_and_this_is_told() {
    use yoto_proto::smpl::JOINTS;
    let dir = tempfile::tempdir().expect("temporary folder");
    write_capture(dir.path(), "", |track| {
        let parent = |above: Option<usize>| above.map_or(-1, |it| it as i32);
        let long = |name: &str| name.replace("l_", "Left").replace("r_", "Right");
        track.skeleton = Skeleton {
            names: JOINTS.iter().map(|(name, _)| long(name)).collect(),
            parents: JOINTS.iter().map(|(_, above)| parent(*above)).collect(),
            rest_joints: vec![[0.0; 3]; JOINTS.len()],
        };
        for frame in &mut track.frames {
            frame.pose = vec![0.0; 72];
        }
    });
    let capture = CaptureDir::open(dir.path()).expect("a good capture");
    let told = |note: &String| note.contains("l_hip for 'Lefthip'");
    assert!(capture.notes.iter().any(told), "{:?}", capture.notes);
    let names = capture
        .planned
        .expect("a folder has one")
        .track
        .skeleton
        .names;
    assert!(
        names.iter().eq(JOINTS.iter().map(|(name, _)| name)),
        "{names:?}"
    );
}

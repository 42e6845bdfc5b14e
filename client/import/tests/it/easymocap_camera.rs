//! EasyMocap's cameras: files of OpenCV beside the poses.

use crate::pose_tools::{files, import, options};
use crate::pose_tools_made::refused;
use yoto_import::{Format, Options, read};

#[test]
fn easymocap_needs_its_camera_and_keeps_its_lens() {
    let dir = tempfile::tempdir().expect("a folder");
    let smpl = dir.path().join("capture/smpl");
    std::fs::create_dir_all(&smpl).expect("a folder");
    for frame in 0..16 {
        let name = format!("{frame:06}.json");
        let from = files("easymocap/output/smpl").join(&name);
        std::fs::copy(from, smpl.join(name)).expect("copies");
    }
    let at = dir.path().join("capture");
    let text = refused(&files("clip/frames"), &options(dir.path(), at.clone()));
    assert!(text.contains("intri.yml: there is no intri.yml"), "{text}");
    std::fs::copy(files("easymocap/extri.yml"), at.join("extri.yml")).expect("copies");
    let text = std::fs::read_to_string(files("easymocap/intri.yml")).expect("reads");
    let lens = "0.000000, 0.000000, 0.000000, 0.000000, 0.000000";
    assert!(text.contains(lens), "{text}");
    std::fs::write(
        at.join("intri.yml"),
        text.replace(lens, "-0.1, 0.02, 0, 0.001, 0"),
    )
    .expect("writes");
    let found = import(&options(dir.path(), at.clone()));
    assert_eq!(found.track.distortion, [-0.1, 0.02, 0.0, 0.001, 0.0]);
    for (numbers, expected) in [
        ("-0.1, 0.02, 0, 0.001", Some([-0.1, 0.02, 0.0, 0.001, 0.0])),
        ("-0.1, much, 0, 0.001, 0", None),
        ("-0.1, 0.02", None),
    ] {
        std::fs::write(at.join("intri.yml"), text.replace(lens, numbers)).expect("writes");
        let read = read(
            Format::AUTO,
            &files("clip/frames"),
            &options(dir.path(), at.clone()),
        );
        match (read, expected) {
            (Ok(found), Some(expected)) => assert_eq!(found.track.distortion, expected),
            (Err(error), None) => {
                let text = error.to_string();
                assert!(
                    text.contains("intri.yml: dist_01: not the 5 numbers"),
                    "{text}"
                );
            }
            (read, _) => panic!("{numbers}: {read:?}"),
        }
    }
    let second = Options {
        camera: Some(1),
        ..options(dir.path(), at.clone())
    };
    let message = refused(&files("clip/frames"), &second);
    assert!(
        message.contains("intri.yml: names: there is no camera 1"),
        "{message}"
    );
    std::fs::write(
        at.join("intri.yml"),
        text.replace("data: [", "data: [nan, "),
    )
    .expect("writes");
    let message = refused(&files("clip/frames"), &options(dir.path(), at));
    assert!(message.contains("intri.yml: K_01"), "{message}");
}

//! A capture's media plan, a zero byte and the paths of its files: sources that are among the files, and the pose
//! track's frames as the plan selects them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_proto::media_plan::{MaskSource, MediaPlan, Pictures, Sources};

/// The pose track that the plan is applied to.
const TRACK: &[u8] = include_bytes!("../corpus/pose_track_json/small");

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(2, |byte| *byte == 0);
    let json = parts.next().unwrap_or_default();
    let paths = String::from_utf8_lossy(parts.next().unwrap_or_default());
    let paths: Vec<&str> = paths.lines().collect();
    let Ok(plan) = serde_json::from_slice::<MediaPlan>(json) else {
        return;
    };
    assert_eq!(plan.clone().over(MediaPlan::default()), plan);
    assert_eq!(MediaPlan::default().over(plan.clone()), plan);
    if let Ok(sources) = Sources::find(&plan, paths.iter().copied()) {
        assert!(is_there(&sources.images, &paths));
        assert!(
            sources
                .mask_pictures()
                .is_none_or(|masks| is_there(&masks, &paths))
        );
        if let MaskSource::Plate(path) = &sources.masks {
            assert!(paths.contains(&path.as_str()));
        }
    }
    match plan.track("poses.json", TRACK) {
        Ok(planned) => {
            assert_eq!(planned.track.check(), []);
            assert_eq!(planned.masks.len(), planned.track.frames.len());
            let mut frames = planned.track.frames.iter();
            assert!(frames.all(|frame| plan.selection.takes(frame.index)));
        }
        Err(violations) => assert!(!violations.is_empty()),
    }
});

fn is_there(pictures: &Pictures, paths: &[&str]) -> bool {
    match pictures {
        Pictures::Video(file) => paths.contains(&file.as_str()),
        Pictures::Folder(folder) => paths.iter().any(|path| {
            let below = path.strip_prefix(folder.as_str());
            below.is_some_and(|below| below.starts_with('/'))
        }),
    }
}

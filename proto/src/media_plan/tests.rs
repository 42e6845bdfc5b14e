//! Plans, names and choices between sources.

use super::*;

fn find(plan: &MediaPlan, paths: &[&str]) -> Result<Sources, Violation> {
    Sources::find(plan, paths.iter().copied())
}

#[test]
fn names_tell_what_files_are_and_pictures_go_before_a_video() {
    let plan = MediaPlan::default();
    let both = [
        "poses.json",
        "video.mp4",
        "frames/000000.png",
        "masks/000000.png",
    ];
    let found = find(&plan, &both).expect("found");
    assert_eq!(found.images, Pictures::Folder("frames".into()));
    assert_eq!(found.masks, MaskSource::Pictures("masks".into()));
    let found = find(&plan, &["video.MOV", "masks.mp4"]).expect("found");
    assert_eq!(found.images, Pictures::Video("video.MOV".into()));
    assert_eq!(
        found.mask_pictures(),
        Some(Pictures::Video("masks.mp4".into()))
    );
    let found = find(&plan, &["video.mp4", "background.jpg"]).expect("found");
    assert_eq!(found.masks, MaskSource::Plate("background.jpg".into()));
    let found = find(&plan, &["frames/a1.webp"]).expect("found");
    assert_eq!(found.masks, MaskSource::Alpha);
    let fault = find(&plan, &["poses.json", "masks/1.png"]).expect_err("no images");
    assert_eq!(fault.field, "images");
}

#[test]
fn a_plan_overrules_names_and_survives_json() {
    let plan = MediaPlan {
        images: Some("video.mp4".into()),
        masks: Some(MaskSource::Plate("clean.png".into())),
        ..MediaPlan::default()
    };
    let json = serde_json::to_string(&plan).expect("writes");
    assert_eq!(
        serde_json::from_str::<MediaPlan>(&json).expect("reads"),
        plan
    );
    let paths = ["frames/1.png", "video.mp4", "clean.png"];
    let found = find(&plan, &paths).expect("found");
    assert_eq!(found.images, Pictures::Video("video.mp4".into()));
    let stem = MediaPlan {
        images: Some("video".into()),
        ..plan.clone()
    };
    let found = find(&stem, &paths).expect("found");
    assert_eq!(found.images, Pictures::Video("video.mp4".into()));
    let field = |paths| find(&plan, paths).expect_err("missing").field;
    assert_eq!(field(&paths[..1]), "images");
    assert_eq!(field(&paths[..2]), "masks");
    let shifted = MediaPlan {
        correction: Correction {
            mask_shift: 1,
            ..Correction::default()
        },
        ..plan.clone()
    };
    let fault = find(&shifted, &paths).expect_err("a plate has no other frames");
    assert_eq!(
        (fault.code.as_str(), fault.field.as_str()),
        ("INVALID", "correction.mask_shift")
    );
    let unknown = serde_json::from_str::<MediaPlan>(r#"{"frame_rate": 3}"#);
    assert!(
        unknown.is_err(),
        "a misspelt field is an error, not ignored"
    );
}

#[test]
fn selections_and_names_count_frames() {
    let selection = Selection {
        first: 3,
        end: Some(9),
        every: 2,
    };
    let taken: Vec<u32> = (0..12).filter(|&i| selection.takes(i)).collect();
    assert_eq!(taken, [3, 5, 7]);
    for (name, index) in [
        ("frames/000017.png", Some(17)),
        ("img_3.final.jpg", Some(3)),
        ("cam2/frame-0042.png", Some(42)),
        ("é7.png", Some(7)),
        ("7é.png", Some(7)),
        ("portrait.png", None),
        ("99999999999.png", None),
    ] {
        assert_eq!(index_in_name(name), index, "{name}");
    }
}

#[test]
fn a_film_is_alone_without_any_other_file() {
    let alone = |paths: &[&'static str]| film_alone(paths.iter().copied());
    assert_eq!(alone(&["IMG_7.MOV"]), Some("IMG_7.MOV"));
    assert_eq!(alone(&["video.mp4", "masks.mp4"]), None);
    assert_eq!(alone(&["poses.json"]), None);
    assert_eq!(alone(&[]), None);
}

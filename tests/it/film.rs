//! A film alone, without poses: the service finds the person. The pose model is not part of the project: what needs it runs where
//! `YOTO_POSE_MODEL` names it, and fails without it where `YOTO_TEST_POSE_MODEL=required`.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_capture::FrameImage;
use yoto_tests::film::write_mp4;
use yoto_tests::process::{PATIENCE, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
/// Sides of the pictures, pixels.
const SIZE: usize = 320;

/// The model's folder.
fn model() -> Option<PathBuf> {
    let path = std::env::var_os("YOTO_POSE_MODEL").map(PathBuf::from);
    let required = std::env::var_os("YOTO_TEST_POSE_MODEL").is_some_and(|it| it == "required");
    assert!(
        path.is_some() || !required,
        "YOTO_POSE_MODEL names no model"
    );
    path
}

/// A film of a person who moves to the right, or of nobody.
fn film(path: &Path, somebody: bool) -> anyhow::Result<()> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let person = image::open(here.join("../worker/landmarks/tests/person.png"))?.to_rgb8();
    let person = image::imageops::resize(
        &person,
        2 * person.width(),
        2 * person.height(),
        image::imageops::FilterType::Triangle,
    );
    let frame = |number: i64| {
        let mut picture = image::RgbImage::new(SIZE as u32, SIZE as u32);
        if somebody {
            image::imageops::replace(&mut picture, &person, 10 + 8 * number, 30);
        }
        FrameImage {
            width: SIZE,
            height: SIZE,
            rgb: picture.into_raw(),
            mask: vec![255; SIZE * SIZE],
        }
    };
    let frames: Vec<FrameImage> = (0..12).map(frame).collect();
    write_mp4(&frames, 15, path)
}

#[test]
fn a_film_alone_is_a_capture_where_a_worker_has_a_pose_model() -> anyhow::Result<()> {
    let Some(model) = model() else {
        return Ok(());
    };
    let dir = tempfile::tempdir()?;
    let [walk, empty] = ["walk.mp4", "empty.mp4"].map(|name| dir.path().join(name));
    film(&walk, true)?;
    film(&empty, false)?;
    let text = |path: &Path| path.to_str().map(str::to_owned).context("a path");
    let (walk, empty) = (text(&walk)?, text(&empty)?);
    let data = dir.path().join("data");
    let service = Service::start_with(YOTO, &data, &["--pose-model", &text(&model)?])?;
    // The worker registers after the address is told.
    let without = "no worker has a pose model";
    let began = Instant::now();
    while service.ask(YOTO, "status", succeed)?.contains(without) {
        ensure!(began.elapsed() < PATIENCE, "the worker has no pose model");
    }
    let said = service.ask(YOTO, &format!("subject add ada {walk}"), succeed)?;
    ensure!(said.contains("subjects/"), "{said}");
    let shown = service.ask(YOTO, "subject show ada", succeed)?;
    ensure!(shown.contains("READY"), "{shown}");
    let refused = service.ask(YOTO, &format!("subject add eve {empty}"), fail)?;
    ensure!(
        refused.contains("nobody was found") && refused.contains("video.mp4"),
        "{refused}"
    );
    Ok(())
}

#[test]
fn without_a_pose_model_a_film_is_refused_before_anybody_is_made_of_it() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let walk = dir.path().join("walk.mp4");
    film(&walk, true)?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let walk = walk.to_str().context("a path")?;
    let refused = service.ask(YOTO, &format!("subject add ada {walk}"), fail)?;
    ensure!(
        refused.contains("no worker of this service has a pose model"),
        "{refused}"
    );
    let people = service.ask(YOTO, "subject list", succeed)?;
    ensure!(!people.contains("ada"), "{people}");
    let folder = dir.path().join("nowhere");
    let folder = folder.to_str().context("a path")?;
    let refused = fail(YOTO, &["serve", "--data", folder, "--pose-model", folder])?;
    ensure!(refused.contains("opening the pose model"), "{refused}");
    Ok(())
}

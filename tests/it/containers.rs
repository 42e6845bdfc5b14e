//! Captures in all forms: a video, archives, masks of several kinds. Each goes through the command
//! line and a real service, and its shard is compared with the original frames.

use anyhow::{Context, ensure};
use std::io::Write;
use std::path::{Path, PathBuf};
use yoto_capture::{FrameImage, Shard};
use yoto_proto::pose_track::Frame;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::film::write_mp4;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Service, fail, output, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 6;
const SIDE: u32 = 64;

/// The newest shard below the service's objects.
fn shard(data: &Path) -> anyhow::Result<Shard> {
    let mut folders = vec![data.join("objects/captures")];
    let mut found: Vec<(std::time::SystemTime, PathBuf)> = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.ends_with("shard.bin") {
                found.push((path.metadata()?.modified()?, path));
            }
        }
    }
    let newest = found.into_iter().max().context("a shard")?.1;
    Ok(Shard::from_bytes(std::fs::read(newest)?)?)
}

/// PSNR of a shard's pictures, dB, over the whole image.
fn psnr(shard: &Shard, truth: &[FrameImage]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (at, truth) in truth.iter().enumerate() {
        for (a, b) in shard.image(at).rgb.iter().zip(&truth.rgb) {
            sum += (f64::from(*a) - f64::from(*b)).powi(2);
            count += 1.0;
        }
    }
    10.0 * (255.0f64 * 255.0 / (sum / count)).log10()
}

fn add(service: &Service, name: &str, capture: &Path, more: &[&str]) -> anyhow::Result<String> {
    let capture = capture.to_str().context("a plain path")?;
    let mut arguments = vec![
        "subject",
        "add",
        name,
        capture,
        "--server",
        &service.address,
    ];
    arguments.extend(more);
    let output = output(YOTO, &arguments)?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(output.status.success(), "{said}");
    Ok(said)
}

#[test]
fn a_film_trains_like_its_pictures_and_says_what_was_read() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (data, ada) = (dir.path().join("data"), dir.path().join("ada"));
    let person = &SyntheticPerson::cast(1, 7)[0];
    write_capture(person, FRAMES, SIDE, &ada)?;
    let (track, truth) = person.capture(FRAMES, SIDE);
    write_mp4(&truth, track.fps.round() as u32, &ada.join("video.mp4"))?;
    let service = Service::start(YOTO, &data, true)?;

    let said = add(&service, "pictures", &ada, &[])?;
    assert!(said.contains("--frames video"), "both are there: {said}");
    assert!(said.contains("bytes per frame"), "{said}");
    let pictures = shard(&data)?;
    assert!(psnr(&pictures, &truth) > 60.0, "PNG loses nothing");

    let said = add(&service, "film", &ada, &["--frames", "video"])?;
    assert!(said.contains("H.264, 64x64, 6 frames"), "{said}");
    assert!(said.contains("background: black"), "{said}");
    let film = shard(&data)?;
    assert_eq!(film.track, pictures.track);
    let quality = psnr(&film, &truth);
    assert!(quality > 28.0, "the film has {quality:.1} dB");
    for (at, truth) in truth.iter().enumerate() {
        assert_eq!(film.image(at).mask, truth.mask, "masks are the pictures");
    }

    let said = add(
        &service,
        "part",
        &ada,
        &["--frames", "video", "--every", "2", "--range", "1.."],
    )?;
    assert!(said.contains("3 frames of 64x64"), "{said}");
    let part = shard(&data)?;
    let indices: Vec<u32> = part.track.frames.iter().map(|frame| frame.index).collect();
    assert_eq!(indices, [1, 3, 5]);
    assert_eq!(part.image(1), film.image(3));
    Ok(())
}

fn tar(dir: &Path, below: &str) -> anyhow::Result<Vec<u8>> {
    let mut builder = tar::Builder::new(Vec::new());
    builder.append_dir_all(below, dir)?;
    Ok(builder.into_inner()?)
}

fn zip(dir: &Path) -> anyhow::Result<Vec<u8>> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for entry in std::fs::read_dir(dir)? {
        let path = entry?.path();
        let name = path
            .file_name()
            .and_then(|it| it.to_str())
            .context("a name")?;
        writer.start_file(name, zip::write::SimpleFileOptions::default())?;
        writer.write_all(&std::fs::read(&path)?)?;
    }
    Ok(writer.finish()?.into_inner())
}

#[test]
fn archives_of_a_capture_or_of_its_parts_are_the_same_capture() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (data, ada) = (dir.path().join("data"), dir.path().join("ada"));
    write_capture(&SyntheticPerson::cast(1, 7)[0], FRAMES, SIDE, &ada)?;
    let service = Service::start(YOTO, &data, true)?;
    add(&service, "folder", &ada, &[])?;
    let expected = shard(&data)?;

    let whole = dir.path().join("ada.tar");
    std::fs::write(&whole, tar(&ada, "captures/ada")?)?;
    add(&service, "whole", &whole, &[])?;
    assert_eq!(shard(&data)?, expected);

    let parts = dir.path().join("parts");
    std::fs::create_dir(&parts)?;
    std::fs::copy(ada.join("poses.json"), parts.join("poses.json"))?;
    std::fs::write(parts.join("frames.zip"), zip(&ada.join("frames"))?)?;
    std::fs::write(parts.join("masks.tar"), tar(&ada.join("masks"), "masks")?)?;
    add(&service, "parts", &parts, &[])?;
    assert_eq!(shard(&data)?, expected);
    let listed = succeed(YOTO, &["subject", "list", "--server", &service.address])?;
    assert_eq!(listed.matches("READY").count(), 3, "{listed}");
    Ok(())
}

/// The person before a synthetic room, and the room alone.
fn in_a_room(truth: &FrameImage) -> (image::RgbImage, image::RgbImage) {
    let room = |x: u32, y: u32| {
        [
            200 - x as u8,
            60 + y as u8,
            180 + (x / 4 + y / 4) as u8 % 2 * 20,
        ]
    };
    let (width, height) = (truth.width as u32, truth.height as u32);
    let seen = image::RgbImage::from_fn(width, height, |x, y| {
        let at = (y * width + x) as usize;
        let through = 255 - u32::from(truth.mask[at]);
        let room = room(x, y);
        image::Rgb(std::array::from_fn(|i| {
            let own = u32::from(truth.rgb[at * 3 + i]);
            (own + (u32::from(room[i]) * through + 127) / 255).min(255) as u8
        }))
    });
    (
        seen,
        image::RgbImage::from_fn(width, height, |x, y| image::Rgb(room(x, y))),
    )
}

#[test]
fn a_room_around_the_person_is_taken_off_by_masks_alpha_or_a_clean_picture() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (data, ada) = (dir.path().join("data"), dir.path().join("ada"));
    let person = &SyntheticPerson::cast(1, 7)[0];
    let track = write_capture(person, FRAMES, SIDE, &ada)?;
    let (_, truth) = person.capture(FRAMES, SIDE);
    let service = Service::start(YOTO, &data, true)?;
    for (frame, truth) in track.frames.iter().zip(&truth) {
        let (seen, room) = in_a_room(truth);
        seen.save(ada.join(format!("frames/{:06}.png", frame.index)))?;
        room.save(ada.join("clean.png"))?;
    }
    let said = add(&service, "masked", &ada, &[])?;
    assert!(said.contains("background: a scene"), "{said}");
    let masked = psnr(&shard(&data)?, &truth);
    assert!(said.contains("edges: solved from colours"), "{said}");

    let said = add(&service, "keyed", &ada, &["--masks", "clean.png"])?;
    assert!(said.contains("difference key against clean.png"), "{said}");
    let keyed = shard(&data)?;
    for (at, truth) in truth.iter().enumerate() {
        let found = overlap(&keyed.image(at).mask, &truth.mask);
        assert!(found > 0.6, "frame {at}: the key finds {found:.2}");
    }

    for (frame, truth) in track.frames.iter().zip(&truth) {
        let (seen, _) = in_a_room(truth);
        let cut = image::RgbaImage::from_fn(seen.width(), seen.height(), |x, y| {
            let [r, g, b] = seen.get_pixel(x, y).0;
            image::Rgba([r, g, b, truth.mask[(y * SIDE + x) as usize]])
        });
        cut.save(ada.join(format!("frames/{:06}.png", frame.index)))?;
    }
    let said = add(&service, "cut-out", &ada, &["--masks", "alpha"])?;
    assert!(said.contains("alpha channel"), "{said}");
    let cut_out = shard(&data)?;
    assert_eq!(cut_out.image(2).mask, truth[2].mask);
    // Its edges keep some of the room; those of masks are solved.
    let cut_out = psnr(&cut_out, &truth);
    assert!(
        cut_out > 35.0 && masked > cut_out,
        "{cut_out:.1} dB, {masked:.1} dB with masks"
    );
    Ok(())
}

/// Masks as a film.
fn write_masks(truth: &[FrameImage], fps: u32, path: &Path) -> anyhow::Result<()> {
    let gray = |frame: &FrameImage| FrameImage {
        rgb: frame.mask.iter().flat_map(|&level| [level; 3]).collect(),
        ..frame.clone()
    };
    let frames: Vec<FrameImage> = truth.iter().map(gray).collect();
    write_mp4(&frames, fps, path)
}

/// Share of the two masks' pixels that is in both.
fn overlap(a: &[u8], b: &[u8]) -> f64 {
    let pairs = || a.iter().zip(b).map(|(a, b)| (*a > 127, *b > 127));
    let both = pairs().filter(|&(a, b)| a && b).count();
    let either = pairs().filter(|&(a, b)| a || b).count();
    both as f64 / either.max(1) as f64
}

#[test]
fn wrong_numbers_and_late_masks_are_mended_in_films_and_archives_too() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (data, ada) = (dir.path().join("data"), dir.path().join("ada"));
    let person = &SyntheticPerson::cast(1, 7)[0];
    let track = write_capture(person, FRAMES, SIDE, &ada)?;
    let (_, truth) = person.capture(FRAMES, SIDE);
    std::fs::remove_dir_all(ada.join("frames"))?;
    std::fs::remove_dir_all(ada.join("masks"))?;
    let fps = track.fps.round() as u32;
    write_mp4(&truth, fps, &ada.join("video.mp4"))?;
    // Each frame's mask is one frame late, and cameras are in millimetres.
    let late: Vec<FrameImage> = truth[..1].iter().chain(&truth).cloned().collect();
    write_masks(&late, fps, &ada.join("masks.mp4"))?;
    let mut poses = serde_json::to_value(&track)?;
    for frame in poses["frames"].as_array_mut().context("frames")? {
        for row in 0..3 {
            let metres = frame["E"][row][3].as_f64().context("a length")?;
            frame["E"][row][3] = (1000.0 * metres).into();
        }
    }
    std::fs::write(ada.join("poses.json"), poses.to_string())?;
    let service = Service::start(YOTO, &data, true)?;
    let right = ["--units", "camera=mm", "--mask-shift", "1"];

    let said = add(&service, "film", &ada, &right)?;
    assert!(
        said.contains("numbers read with --units camera=mm"),
        "{said}"
    );
    let film = shard(&data)?;
    assert_eq!(film.frames(), FRAMES - 1);
    for (found, expected) in film.track.frames.iter().zip(&track.frames) {
        assert_eq!(found.index, expected.index);
        let metres = |frame: &Frame| [0, 1, 2].map(|row| frame.e[row][3]);
        for (a, b) in metres(found).into_iter().zip(metres(expected)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
    for (at, truth) in truth[..FRAMES - 1].iter().enumerate() {
        let same = overlap(&film.image(at).mask, &truth.mask);
        assert!(same > 0.9, "frame {at}: {same:.2}");
    }

    let packed = dir.path().join("ada.tar");
    std::fs::write(&packed, tar(&ada, "ada")?)?;
    add(&service, "packed", &packed, &right)?;
    assert_eq!(shard(&data)?, film);

    // The check reads videos and archives like ingest, and finds the faults.
    let out = dir.path().join("check");
    let out = out.to_str().context("a plain path")?;
    for capture in [&ada, &packed] {
        let capture = capture.to_str().context("a plain path")?;
        let said = fail(
            YOTO,
            &["capture", "check", capture, "--out", out, "--force"],
        )?;
        assert!(said.contains("measures failed"), "{said}");
        let report = std::fs::read_to_string(dir.path().join("check/report.json"))?;
        assert!(report.contains("--units camera=mm"), "{report}");
        let mut mended = vec!["capture", "check", capture, "--out", out, "--force"];
        mended.extend(right);
        let checked = output(YOTO, &mended)?;
        let said = String::from_utf8_lossy(&checked.stdout).into_owned();
        assert!(said.contains("pass  reading of the numbers"), "{said}");
        assert!(said.contains("pass  joints in the mask"), "{said}");
    }
    let folder = ada.to_str().context("a plain path")?;
    let said = fail(YOTO, &["capture", "check", folder, "--out", out])?;
    assert!(
        said.contains("is there already, of") && said.contains("ada.tar"),
        "{said}"
    );

    // A capture's own plan applies without options, in archives and in folders.
    let plan = r#"{"correction": {"units": {"camera": "mm"}, "mask_shift": 1}}"#;
    std::fs::write(ada.join("media.json"), plan)?;
    std::fs::write(&packed, tar(&ada, "ada")?)?;
    add(&service, "planned", &ada, &[])?;
    assert_eq!(shard(&data)?, film);
    add(&service, "planned and packed", &packed, &["--every", "2"])?;
    assert_eq!(shard(&data)?.image(1), film.image(2));
    Ok(())
}

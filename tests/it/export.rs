//! Exports of people to files that other programs play.

use anyhow::{Context, ensure};
use std::path::PathBuf;
use tempfile::TempDir;
use yoto_avatar::evaluate::metrics::psnr;
use yoto_media::Limits;
use yoto_media::film::Film;
use yoto_media::video::{Ffmpeg, Video};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::browser::Browser;
use yoto_tests::page::clips;
use yoto_tests::people::write_capture;
use yoto_tests::playback::played;
use yoto_tests::process::{Service, fail, succeed};
use yoto_tests::{element, phone};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const LAB: &str = env!("CARGO_BIN_EXE_yoto-lab-under-test");
const FRAMES: usize = 12;
const SIZE: u32 = 96;
/// The frame that browser and renderer draw.
const FRAME: usize = 5;

type Run = fn(&str, &[&str]) -> anyhow::Result<String>;

/// A service with Ada in two trained models: `solo` consists of splats, `field` is a field.
struct Stage {
    service: Service,
    track: PoseTrack,
    // Dropped last: the service writes to it until it has ended.
    dir: TempDir,
}

impl Stage {
    fn new() -> anyhow::Result<Self> {
        let dir = tempfile::tempdir()?;
        let person = &SyntheticPerson::cast(1, 7)[0];
        let track = write_capture(person, FRAMES, SIZE, &dir.path().join("ada"))?;
        let service = Service::start(YOTO, &dir.path().join("data"), true)?;
        let stage = Self {
            service,
            track,
            dir,
        };
        stage.yoto(&format!("subject add ada {}", stage.at("ada")), succeed)?;
        stage.yoto(
            "train solo --subjects ada --tier splat --harmonics 2 --steps 30",
            succeed,
        )?;
        stage.yoto(
            "train field --subjects ada --tier draft --steps 100",
            succeed,
        )?;
        Ok(stage)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// The path of `name` on a command line.
    fn at(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Runs a command on the service.
    fn yoto(&self, line: &str, run: Run) -> anyhow::Result<String> {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", &self.service.address]);
        run(YOTO, &arguments)
    }

    /// Runs a command that needs no service.
    fn local(&self, line: &str) -> anyhow::Result<String> {
        succeed(YOTO, &line.split(' ').collect::<Vec<_>>())
    }

    /// The beginning of an export of Ada.
    fn export(&self) -> String {
        let capture = self.at("ada");
        format!("export solo --subject ada --capture {capture}")
    }

    /// A render of Ada's own motion to an MP4.
    fn film(&self) -> String {
        let out = self.at("walk.mp4");
        format!("render solo --subject ada --motion ada --size 64 --out {out}")
    }

    fn distill(&self, model: &str, run: Run) -> anyhow::Result<String> {
        let (capture, out) = (self.at("ada"), self.at("distilled"));
        let line = format!("distill {model} --capture {capture} --size 64 --seconds 4 --out {out}");
        run(LAB, &line.split(' ').collect::<Vec<_>>())
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_leaves_in_a_page_and_a_file_of_splats() -> anyhow::Result<()> {
    let stage = Stage::new()?;
    page_and_splats(&stage)?;
    motion_files(&stage)?;
    other_forms(&stage)?;
    films(&stage)?;
    existing_files(&stage)?;
    real_time(&stage)?;
    refusals(&stage)?;
    distillation(&stage)?;
    page_in_a_browser(&stage)
}

fn page_and_splats(stage: &Stage) -> anyhow::Result<()> {
    let export = stage.export();
    stage.yoto(&format!("{export} --out {}", stage.at("ada.html")), succeed)?;
    stage.yoto(
        &format!("{export} --frame {FRAME} --out {}", stage.at("ada.ply")),
        succeed,
    )?;
    let ply = std::fs::read(stage.path("ada.ply"))?;
    ensure!(ply.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex "));
    Ok(())
}

fn motion_files(stage: &Stage) -> anyhow::Result<()> {
    let export = stage.export();
    // A motion file is a clip like a capture's motion, of every second frame here.
    std::fs::copy(
        stage.path("ada").join("poses.json"),
        stage.path("dance.json"),
    )?;
    let moves = format!(
        "{export} --motion-file {} --range ..:2",
        stage.at("dance.json")
    );
    stage.yoto(
        &format!("{moves} --out {}", stage.at("moves.html")),
        succeed,
    )?;
    let page = std::fs::read_to_string(stage.path("moves.html"))?;
    ensure!(
        clips(&page)? == [("ada".into(), FRAMES), ("dance".into(), FRAMES / 2)],
        "{:?}",
        clips(&page)?
    );
    let options = "--triangles 500 --texture 64";
    stage.yoto(
        &format!("{moves} {options} --out {}", stage.at("moves.glb")),
        succeed,
    )?;
    let glb = std::fs::read(stage.path("moves.glb"))?;
    let length = u32::from_le_bytes(glb[12..16].try_into()?) as usize;
    let gltf: serde_json::Value = serde_json::from_slice(&glb[20..20 + length])?;
    ensure!(gltf["animations"][0]["name"] == "ada" && gltf["animations"][1]["name"] == "dance");
    Ok(())
}

fn other_forms(stage: &Stage) -> anyhow::Result<()> {
    let export = stage.export();
    // Other forms; their contents have their own tests.
    for (name, options, start) in [
        ("ada.spz", " --frame 5", &b"\x1f\x8b"[..]),
        ("splats.glb", " --frame 5 --format splats", &b"glTF"[..]),
        ("ada.glb", " --triangles 4000 --texture 256", &b"glTF"[..]),
        (
            "ada.obj",
            " --frame 5 --triangles 4000 --texture 256",
            &b"# metres"[..],
        ),
        (
            "mesh.ply",
            " --frame 5 --format ply-mesh --triangles 4000",
            &b"ply\nformat"[..],
        ),
        ("LOUD.SPZ", " --frame 5", &b"\x1f\x8b"[..]),
    ] {
        let line = format!("{export}{options} --out {}", stage.at(name));
        stage.yoto(&line, succeed)?;
        let file = std::fs::read(stage.path(name))?;
        ensure!(file.starts_with(start), "{line}");
    }
    let texture = image::open(stage.path("ada.png"))?;
    ensure!(texture.width() >= 64 && stage.path("ada.mtl").exists());
    Ok(())
}

fn films(stage: &Stage) -> anyhow::Result<()> {
    let film = stage.film();
    stage.yoto(&film, succeed)?;
    let video = Video::open(
        &stage.path("walk.mp4"),
        &Limits::default(),
        &Ffmpeg::none(),
        true,
    )?;
    ensure!(video.frames() == Some(FRAMES), "{:?}", video.frames());
    let seconds = video.times().last().context("no times")?;
    let expected = (FRAMES - 1) as f64 / stage.track.fps;
    ensure!(
        (seconds - expected).abs() < 0.01,
        "{seconds} s, not {expected}"
    );
    for (options, cause) in [
        (" --transparent", "an .mp4 or .gif has no transparency"),
        (" --animate", "an .mp4, .webp or .gif is one film"),
    ] {
        let said = stage.yoto(&format!("{film} --force{options}"), fail)?;
        ensure!(said.contains(cause), "{said}");
    }
    let film_of = format!(
        "render solo --subject ada --motion ada --size 64 --transparent --out {}",
        stage.at("walk.webp")
    );
    stage.yoto(&film_of, succeed)?;
    let webp = std::fs::read(stage.path("walk.webp"))?;
    ensure!(
        &webp[8..16] == b"WEBPVP8X" && webp[20] & 0x12 == 0x12,
        "animated, with opacity"
    );
    Ok(())
}

fn existing_files(stage: &Stage) -> anyhow::Result<()> {
    let (film, export) = (stage.film(), stage.export());
    // An existing file is replaced only on request.
    let said = stage.yoto(&film, fail)?;
    ensure!(said.contains("walk.mp4 is there already"), "{said}");
    let said = stage.yoto(&format!("{export} --out {}", stage.at("ada.html")), fail)?;
    ensure!(
        said.contains("is there already") && said.contains("--force"),
        "{said}"
    );
    stage.yoto(
        &format!("{export} --force --out {}", stage.at("ada.html")),
        succeed,
    )?;
    Ok(())
}

fn real_time(stage: &Stage) -> anyhow::Result<()> {
    // Splats are drawn in real time without a measurement.
    let line = format!(
        "render solo --subject ada --orbit 0 --views 2 --size 64 --quality realtime --out {}",
        stage.at("quick")
    );
    stage.yoto(&line, succeed)?;
    ensure!(stage.path("quick").join("000001.png").exists());
    Ok(())
}

fn refusals(stage: &Stage) -> anyhow::Result<()> {
    let export = stage.export();
    for (line, cause) in [
        (
            "export solo --subject ada --out x.fbx",
            "must be one of .html, .ply, .spz, .glb or .obj",
        ),
        (
            "export solo --subject ada --out x.ply --triangles 500",
            "belong to a mesh",
        ),
        (
            "export solo --subject ada --out x.spz --format mesh",
            "--out x.spz ends with .spz, but --format mesh needs .glb, .obj or .ply",
        ),
        (
            "render solo --subject ada --orbit 0 --fps 20 --out x",
            "--fps belongs to --animate or to a film",
        ),
        (
            "export solo --subject ada --out x.html --range 0..9",
            "--range belongs to --motion and --motion-file",
        ),
        (
            "export solo --subject ada --out x.html --up z",
            "--joint-map and --up belong to --motion-file",
        ),
        (
            "render field --subject ada --orbit 0 --views 1 --quality realtime --out x",
            "the tier splat",
        ),
        ("export solo --subject bob --out x.ply", "bob"),
        ("export solo --out x.ply", "--subject is needed"),
        (
            "export solo --subject ada --slot 1 --out x.ply",
            "cannot be used with",
        ),
    ] {
        let said = stage.yoto(line, fail)?;
        ensure!(said.contains(cause), "{line}: {said}");
    }
    let said = stage.yoto(
        &format!("{export} --frame 99 --out {}", stage.at("x.ply")),
        fail,
    )?;
    ensure!(said.contains("no frame 99 among its 12"), "{said}");
    Ok(())
}

/// Splats can be made from a field in a folder.
fn distillation(stage: &Stage) -> anyhow::Result<()> {
    stage.yoto(
        &format!("model export solo --out {}", stage.at("model")),
        succeed,
    )?;
    stage.yoto(
        &format!("model export field --out {}", stage.at("field")),
        succeed,
    )?;
    let said = stage.distill(&stage.at("field"), succeed)?;
    ensure!(said.contains("dB to the field"), "{said}");
    let line = format!(
        "export {} --slot 0 --out {}",
        stage.at("distilled"),
        stage.at("distilled.ply")
    );
    stage.local(&line)?;
    for (model, cause) in [
        (stage.at("model"), "is there already"),
        (stage.at("other"), "other"),
    ] {
        let said = stage.distill(&model, fail)?;
        ensure!(said.contains(cause), "{said}");
        std::fs::remove_dir_all(stage.at("distilled")).ok();
    }
    let said = stage.distill(&stage.at("model"), fail)?;
    ensure!(said.contains("has splats already"), "{said}");
    Ok(())
}

/// The page's controls, and then a frame as the renderer draws it from the same model.
fn page_in_a_browser(stage: &Stage) -> anyhow::Result<()> {
    let render = format!(
        "render-frame --model-dir {} --capture {} --camera train --frame {FRAME} --out {}",
        stage.at("model"),
        stage.at("ada"),
        stage.at("frame.png")
    );
    succeed(LAB, &render.split(' ').collect::<Vec<_>>())?;
    let Some(browser) = Browser::find()? else {
        eprintln!("no browser here: the page is not drawn");
        return Ok(());
    };
    let frame = &stage.track.frames[FRAME];
    let k = &frame.k;
    let lens = [k[0][0], k[1][1], k[0][2], k[1][2]];
    let hold = serde_json::json!([0, FRAME, &frame.e[..3], lens, SIZE, SIZE]);
    let page = std::fs::read_to_string(stage.path("ada.html"))?;
    element::tried(&browser, &page)?;
    let drawn = phone::tried(&browser, &page, &hold)?;
    let over_black = drawn.pixels().flat_map(|pixel| {
        let [r, g, b, a] = pixel.0.map(|value| f32::from(value) / 255.0);
        [r * a, g * a, b * a]
    });
    let rendered = image::open(stage.path("frame.png"))?.to_rgb8();
    let rendered: Vec<f32> = rendered.iter().map(|v| f32::from(*v) / 255.0).collect();
    let alike = psnr(&over_black.collect::<Vec<f32>>(), &rendered);
    eprintln!("browser and renderer: {alike:.1} dB");
    ensure!(alike > 50.0, "browser and renderer differ: {alike:.1} dB");
    Ok(())
}

#[test]
fn a_browser_plays_a_film_and_jumps_in_it() -> anyhow::Result<()> {
    const LENGTH: usize = 40;
    const FPS: f64 = 20.0;
    let Some(browser) = Browser::find()? else {
        eprintln!("no browser here: the film is not played");
        return Ok(());
    };
    // Neighbours differ by far more than the encoder does.
    let grey = |frame: usize| 20 + 40 * (frame % 6) as u8;
    let mut bytes = Vec::new();
    let mut film = Film::new(&mut bytes, 64, 48, FPS)?;
    for frame in 0..LENGTH {
        film.push(&[grey(frame); 3 * 64 * 48])?;
    }
    film.finish()?;
    // Jumps forth and back; frame 31 follows the second key frame.
    let frames = [38, 3, 22, 31];
    let times = frames.map(|frame| (frame as f64 + 0.5) / FPS);
    let playback = played(&browser, &bytes, FPS, &times)?;
    ensure!(
        (playback.width, playback.height) == (64, 48),
        "{playback:?}"
    );
    // Players differ in whether the last frame has a length.
    let seconds = LENGTH as f64 / FPS;
    ensure!(
        (playback.seconds - seconds).abs() < 1.5 / FPS,
        "{playback:?}"
    );
    ensure!(playback.reds.len() == frames.len(), "{playback:?}");
    for (frame, red) in frames.into_iter().zip(&playback.reds) {
        ensure!(
            red.abs_diff(grey(frame)) < 12,
            "frame {frame}: {playback:?}"
        );
    }
    Ok(())
}

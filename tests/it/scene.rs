//! Several people in one picture, and light.

use anyhow::ensure;
use image::RgbaImage;
use serde_json::{Value, json};
use std::path::Path;
use yoto_avatar::evaluate::metrics::psnr;
use yoto_media::Limits;
use yoto_media::video::{Ffmpeg, Video};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::{write_capture, write_json};
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 12;
const SIZE: u32 = 96;

/// A picture that `yoto render` has written into `folder`.
fn picture(folder: &Path, index: usize) -> anyhow::Result<RgbaImage> {
    Ok(image::open(folder.join(format!("{index:06}.png")))?.to_rgba8())
}

fn values(picture: &RgbaImage) -> Vec<f32> {
    picture
        .as_raw()
        .iter()
        .map(|v| f32::from(*v) / 255.0)
        .collect()
}

/// Ada behind, at frame 0 of her capture, and Bob in front of her.
fn scene(actors: &[Value]) -> Value {
    json!({
        "size": [SIZE, SIZE],
        "transparent": true,
        "actors": actors,
        "camera": {"keys": [{"seconds": 0, "eye": [0, 1, 5], "target": [0, 1, 0]}]},
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn people_of_a_scene_hide_each_other() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let at = |name: &str| dir.path().join(name).display().to_string();
    let cast = SyntheticPerson::cast(2, 7);
    let mut tracks = Vec::new();
    for (person, name) in cast.iter().zip(["ada", "bob"]) {
        tracks.push(write_capture(person, FRAMES, SIZE, &dir.path().join(name))?);
    }
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    for name in ["ada", "bob"] {
        yoto(&format!("subject add {name} {}", at(name)), succeed)?;
    }
    yoto(
        "train duo --subjects ada,bob --tier splat --steps 30",
        succeed,
    )?;
    let render = |name: &str, scene: &Value| -> anyhow::Result<String> {
        write_json(&dir.path().join("scene.json"), scene)?;
        let line = format!("render duo --scene {} --out {}", at("scene.json"), at(name));
        yoto(&line, succeed)
    };

    let ada = json!({"subject": "ada", "motion": {"frame": 0}});
    let bob = json!({"subject": "bob", "motion": {"frame": 0}, "at": [0.1, 1.0], "heading": 40});
    render("both", &scene(&[ada.clone(), bob.clone()]))?;
    render("back", &scene(std::slice::from_ref(&ada)))?;
    render("front", &scene(std::slice::from_ref(&bob)))?;
    let [both, back, front] = ["both", "back", "front"].map(|it| picture(&dir.path().join(it), 0));
    let (both, back, front) = (both?, back?, front?);
    let (mut hidden, mut free) = (0, 0);
    for (x, y, pixel) in both.enumerate_pixels() {
        let (back, front) = (back.get_pixel(x, y), front.get_pixel(x, y));
        let same =
            |other: &image::Rgba<u8>| pixel.0.iter().zip(other.0).all(|(a, b)| a.abs_diff(b) <= 3);
        if front.0[3] >= 253 {
            ensure!(same(front), "({x}, {y}): {pixel:?}, in front {front:?}");
            hidden += usize::from(back.0[3] > 127);
        } else if front.0[3] == 0 && back.0[3] >= 253 {
            ensure!(same(back), "({x}, {y}): {pixel:?}, behind {back:?}");
            free += 1;
        }
    }
    ensure!(hidden > 100 && free > 50, "{hidden} hidden, {free} free");

    // The camera that filmed a motion sees the same in a scene.
    let filmed = |heading: f64| {
        let motion = json!({"range": "2..6"});
        let ada = json!({"subject": "ada", "motion": motion, "at": [3, -2], "heading": heading,
            "light": "none"});
        json!({"size": [SIZE, SIZE], "actors": [ada], "camera": {"capture": 0}})
    };
    render("filmed", &filmed(25.0))?;
    let motion = "render duo --subject ada --motion ada --range 2..6 --light none";
    yoto(
        &format!("{motion} --size {SIZE} --out {}", at("motion")),
        succeed,
    )?;
    for index in 0..4 {
        let [one, other] = ["filmed", "motion"].map(|it| picture(&dir.path().join(it), index));
        let likeness = psnr(&values(&one?), &values(&other?));
        ensure!(likeness > 45.0, "picture {index}: {likeness} dB");
    }
    // So does a held-out camera at the same place, in a part of the film.
    let poses = std::fs::read(dir.path().join("ada/poses.json"))?;
    let mut poses: Value = serde_json::from_slice(&poses)?;
    let (k, e) = (tracks[0].frames[2].k, tracks[0].frames[2].e);
    poses["eval"] = json!({"side": {"K": k, "E": e, "frames": [2]}});
    std::fs::create_dir(dir.path().join("held"))?;
    write_json(&dir.path().join("held/poses.json"), &poses)?;
    let mut held = filmed(25.0);
    held["camera"] = json!({"held_out": {"actor": 0, "camera": "side", "folder": "held"}});
    held["range"] = json!("..1");
    render("held-out", &held)?;
    let [one, other] = ["filmed", "held-out"].map(|it| picture(&dir.path().join(it), 0));
    let likeness = psnr(&values(&one?), &values(&other?));
    ensure!(likeness > 45.0, "from a held-out camera: {likeness} dB");
    let more = dir.path().join("held-out/000001.png");
    ensure!(!more.exists(), "more than one picture");
    // Light changes colours.
    let own = motion.replace("none", "own");
    yoto(&format!("{own} --size {SIZE} --out {}", at("own")), succeed)?;
    let [own, none] = ["own", "motion"].map(|it| picture(&dir.path().join(it), 0));
    ensure!(own?.as_raw() != none?.as_raw(), "the light changes nothing");

    // A film is as long as it should be.
    let walk =
        json!({"subject": "ada", "motion": {"capture": "bob"}, "repeat": true, "speed": 0.5});
    let film = json!({"size": [64, 48], "fps": 10, "seconds": 1.5, "actors": [walk, bob],
        "background": [0.2, 0.3, 0.4], "camera": {"orbit": {"sweep": 360, "elevation": 15}}});
    render("scene.mp4", &film)?;
    let path = dir.path().join("scene.mp4");
    let video = Video::open(&path, &Limits::default(), &Ffmpeg::none(), true)?;
    ensure!(video.frames() == Some(15), "{:?} frames", video.frames());

    layers(dir.path(), yoto, &ada)?;
    refusals(dir.path(), yoto, &ada)
}

/// Backgrounds, depth and opacity, the filmed picture beside the rendered one, and turntables.
fn layers(
    dir: &Path,
    yoto: impl Fn(&str, fn(&str, &[&str]) -> anyhow::Result<String>) -> anyhow::Result<String>,
    ada: &Value,
) -> anyhow::Result<()> {
    let at = |name: &str| dir.join(name).display().to_string();
    let render =
        |what: &str, out: &str| yoto(&format!("render duo {what} --out {}", at(out)), succeed);
    let shown = |mut scene: Value, out: &str| {
        scene["camera"] =
            json!({"keys": [{"seconds": 0, "eye": [0, 2, 4], "target": [0, 0.6, 0]}]});
        write_json(&dir.join("shown.json"), &scene)?;
        render(&format!("--scene {}", at("shown.json")), out)?;
        picture(&dir.join(out), 0)
    };
    RgbaImage::from_pixel(40, 20, image::Rgba([200, 100, 50, 255])).save(dir.join("wall.png"))?;
    let plain = json!({"size": [SIZE, SIZE], "actors": [ada], "backdrop": "wall.png"});
    let mut shady = plain.clone();
    shady["shadow"] = json!(true);
    let mut floating = scene(std::slice::from_ref(ada));
    floating["shadow"] = json!(true);
    let clear = shown(scene(std::slice::from_ref(ada)), "clear")?;
    let (plain, shady) = (shown(plain, "plain")?, shown(shady, "shady")?);
    let floating = shown(floating, "floating")?;
    let (mut people, mut dark) = (0, 0);
    for (x, y, before) in clear.enumerate_pixels() {
        let (plain, shady) = (plain.get_pixel(x, y).0, shady.get_pixel(x, y).0);
        let floating = floating.get_pixel(x, y).0;
        match before.0[3] {
            0 => {
                ensure!(plain == [200, 100, 50, 255], "({x}, {y}): {plain:?}");
                // The shadow takes the same share of each colour, and has that share as opacity over a
                // transparent background.
                let share = 1.0 - f32::from(shady[0]) / 200.0;
                let opaque = f32::from(floating[3]) / 255.0;
                ensure!(
                    (share - opaque).abs() < 0.01,
                    "({x}, {y}): {share}, {opaque}"
                );
                dark += usize::from(share > 0.2);
            }
            253.. => {
                let near = plain.iter().zip(shady).all(|(a, b)| a.abs_diff(b) <= 2);
                ensure!(near, "({x}, {y}): the person changed: {plain:?}, {shady:?}");
                people += 1;
            }
            _ => (),
        }
    }
    ensure!(people > 100 && dark > 20, "{people} of people, {dark} dark");

    let own = format!("--subject ada --motion ada --range 2..4 --size {SIZE}");
    render(&format!("{own} --transparent"), "cut")?;
    render(&format!("{own} --layer opacity"), "opacity")?;
    render(&format!("{own} --layer depth"), "depth")?;
    let [cut, opacity, depth] = ["cut", "opacity", "depth"].map(|it| picture(&dir.join(it), 0));
    let (opacity, depth) = (opacity?, depth?);
    for (x, y, cut) in cut?.enumerate_pixels() {
        let (opacity, depth) = (opacity.get_pixel(x, y).0, depth.get_pixel(x, y).0);
        ensure!(
            opacity[..3] == [cut.0[3]; 3],
            "({x}, {y}): {opacity:?}, {cut:?}"
        );
        let known = depth[0] > 0;
        ensure!(
            known == (cut.0[3] >= 128) || cut.0[3].abs_diff(128) < 2,
            "({x}, {y}): {depth:?}"
        );
    }

    render(&format!("{own} --compare truth"), "pair")?;
    render(&own, "alone")?;
    let (pair, alone) = (
        picture(&dir.join("pair"), 1)?,
        picture(&dir.join("alone"), 1)?,
    );
    ensure!(
        pair.dimensions() == (2 * SIZE, SIZE),
        "{:?}",
        pair.dimensions()
    );
    let half = |left: u32| image::imageops::crop_imm(&pair, left, 0, SIZE, SIZE).to_image();
    ensure!(
        half(SIZE) == alone,
        "the right side is not the rendered picture"
    );
    let filmed = psnr(&values(&half(0)), &values(&alone));
    ensure!(
        (10.0..60.0).contains(&filmed),
        "{filmed} dB to the filmed picture"
    );
    let other = format!(
        "render duo --subject bob --motion ada --compare truth --out {}",
        at("no")
    );
    let said = yoto(&other, fail)?;
    ensure!(said.contains("view 0 was not filmed"), "{said}");
    let said = yoto(
        &format!(
            "render duo {own} --transparent --layer depth --out {}",
            at("no")
        ),
        fail,
    )?;
    ensure!(
        said.contains("depth and opacity have no background"),
        "{said}"
    );

    render("--subject ada --turntable --size 48", "round.gif")?;
    let gif = image::codecs::gif::GifDecoder::new(std::io::BufReader::new(std::fs::File::open(
        dir.join("round.gif"),
    )?))?;
    let frames = image::AnimationDecoder::into_frames(gif).collect_frames()?;
    ensure!(frames.len() == FRAMES, "{} frames", frames.len());
    Ok(())
}

fn refusals(
    dir: &Path,
    yoto: impl Fn(&str, fn(&str, &[&str]) -> anyhow::Result<String>) -> anyhow::Result<String>,
    ada: &Value,
) -> anyhow::Result<()> {
    let file = dir.join("bad.json");
    let out = dir.join("bad");
    let refused = |scene: &Value, model: &str| {
        write_json(&file, scene)?;
        let (file, out) = (file.display(), out.display());
        yoto(&format!("render {model} --scene {file} --out {out}"), fail)
    };
    let mut tall = scene(std::slice::from_ref(ada));
    tall["size"] = json!([64, 5000]);
    let mut unknown = ada.clone();
    unknown["subject"] = json!("eve");
    let mut late = ada.clone();
    late["motion"] = json!({"frame": 99});
    let mut odd = ada.clone();
    odd["pose"] = json!(3);
    let backed = |picture: &str| {
        let picture = Path::new("ada").join(picture);
        json!({"size": [64, 64], "actors": [ada], "backdrop": picture})
    };
    for (scene, cause) in [
        (tall, "height: 5000 pixels"),
        (scene(&[unknown]), "eve"),
        (scene(&[late]), "frames 0 to 11, not 99"),
        (scene(&[odd]), "actors[0].pose"),
        (scene(&[]), "0 actors"),
        (backed("poses.json"), "backdrop"),
        (backed("missing.png"), "missing.png"),
    ] {
        let said = refused(&scene, "duo")?;
        ensure!(said.contains(cause), "{said}");
        ensure!(!out.exists(), "{cause}: something was written");
    }
    yoto("train fog --subjects ada --tier draft --steps 2", succeed)?;
    let mut lit = ada.clone();
    lit["light"] = json!("none");
    let said = refused(&scene(&[lit]), "fog")?;
    ensure!(said.contains("only models of splats"), "{said}");
    write_json(&file, &scene(std::slice::from_ref(ada)))?;
    let (file, fog) = (file.display(), dir.join("fog"));
    yoto(
        &format!("render fog --scene {file} --out {}", fog.display()),
        succeed,
    )?;
    picture(&fog, 0)?;
    Ok(())
}

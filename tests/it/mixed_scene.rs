//! People of two models in one scene: one made of splats, one of a field.

use anyhow::{Context, ensure};
use image::RgbaImage;
use serde_json::{Value, json};
use std::path::Path;
use yoto_client::YotoClient;
use yoto_proto::v1::{RenderResult, job_result};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::{write_capture, write_json};
use yoto_tests::process::{Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 64;
/// Opacity of what counts as solid.
const SOLID: u8 = 230;

/// A service with Ada in duo, a model of splats, and Bob in fog, one of fields.
struct Stage {
    dir: tempfile::TempDir,
    service: Service,
}

impl Stage {
    fn new() -> anyhow::Result<Self> {
        let dir = tempfile::tempdir()?;
        let service = Service::start(YOTO, &dir.path().join("data"), true)?;
        let stage = Self { dir, service };
        for (person, name) in SyntheticPerson::cast(2, 7).iter().zip(["ada", "bob"]) {
            let folder = stage.dir.path().join(name);
            write_capture(person, 12, SIZE, &folder)?;
            let folder = folder.display().to_string();
            stage.yoto(&["subject", "add", name, &folder], succeed)?;
        }
        for (model, person, tier, steps) in [
            ("duo", "ada", "splat", "40"),
            ("fog", "bob", "draft", "150"),
        ] {
            let line = ["train", model, "--subjects", person, "--tier", tier];
            stage.yoto(&[&line[..], &["--steps", steps]].concat(), succeed)?;
        }
        Ok(stage)
    }

    fn yoto(
        &self,
        arguments: &[&str],
        run: fn(&str, &[&str]) -> anyhow::Result<String>,
    ) -> anyhow::Result<String> {
        run(
            YOTO,
            &[arguments, &["--server", &self.service.address]].concat(),
        )
    }

    /// Runs `yoto render` of `scene` into the folder `out`, with more `options`.
    fn render(
        &self,
        model: &str,
        scene: &Value,
        out: &str,
        options: &[&str],
        run: fn(&str, &[&str]) -> anyhow::Result<String>,
    ) -> anyhow::Result<String> {
        let file = self.dir.path().join("scene.json");
        write_json(&file, scene)?;
        let out = self.dir.path().join(out);
        let (file, out) = (file.display().to_string(), out.display().to_string());
        let line = ["render", model, "--scene", &file, "--out", &out];
        self.yoto(&[&line[..], options].concat(), run)
    }

    /// The one picture of a scene of `actors`, transparent unless it shows a layer.
    fn picture(&self, model: &str, actors: &[&Value], layer: &[&str]) -> anyhow::Result<RgbaImage> {
        let mut scene = scene(actors);
        scene["transparent"] = json!(layer.is_empty());
        let options = [&["--force"], layer].concat();
        self.render(model, &scene, "picture", &options, succeed)?;
        let path = self.dir.path().join("picture/000000.png");
        Ok(image::open(path)?.to_rgba8())
    }

    /// Result of the newest render.
    async fn result(&self) -> anyhow::Result<RenderResult> {
        let client = YotoClient::connect(&self.service.address).await?;
        let newest = client.list_jobs().await?;
        let newest = client
            .get_job(&newest.first().context("a job")?.name)
            .await?;
        match newest.result.and_then(|it| it.kind) {
            Some(job_result::Kind::Render(result)) => Ok(result),
            other => anyhow::bail!("no render: {other:?}"),
        }
    }
}

/// Seen from 5 m in front of the middle.
fn scene(actors: &[&Value]) -> Value {
    json!({
        "size": [SIZE, SIZE],
        "actors": actors,
        "camera": {"keys": [{"seconds": 0, "eye": [0, 1, 5], "target": [0, 1, 0]}]},
    })
}

/// A person who stands still at `at`: x to the right, z towards the camera.
fn still(subject: &str, model: &str, at: [f64; 2]) -> Value {
    json!({"subject": subject, "model": model, "motion": {"frame": 0}, "at": at})
}

/// The composited colour of `front` over `back` at a pixel, premultiplied by opacity.
fn over(front: [u8; 4], back: [u8; 4]) -> [f32; 3] {
    let premultiplied = |pixel: [u8; 4], c: usize| {
        let [value, alpha] = [pixel[c], pixel[3]].map(f32::from);
        value * alpha / 255.0
    };
    let through = 1.0 - f32::from(front[3]) / 255.0;
    std::array::from_fn(|c| premultiplied(front, c) + through * premultiplied(back, c))
}

/// The nearer person hides the other one, in colours and in depth: pictures of `near` at 4 m and `far` at 5 m,
/// by their models.
async fn hides(stage: &Stage, near: &Value, far: &Value) -> anyhow::Result<()> {
    let alone = |actor: &Value| {
        let model = actor["model"].as_str().context("a model")?;
        stage.picture(model, &[actor], &[])
    };
    let (front, back) = (alone(near)?, alone(far)?);
    let both = stage.picture("duo", &[near, far], &[])?;
    let depth = stage.picture("duo", &[near, far], &["--layer", "depth"])?;
    let result = stage.result().await?;
    let depth_near = result.depth_near.context("a nearest depth")?;
    let depth_far = result.depth_far.context("a farthest depth")?;
    let (mut hidden, mut free) = (0, 0);
    for (x, y, seen) in both.enumerate_pixels() {
        let (front, back) = (front.get_pixel(x, y).0, back.get_pixel(x, y).0);
        let expected = over(front, back);
        let apart = over(seen.0, [0; 4]).into_iter().zip(expected);
        let apart = apart.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        ensure!(apart < 6.0, "({x}, {y}): {seen:?}, not {expected:?}");
        let grey = f64::from(depth.get_pixel(x, y).0[0]);
        let metres = depth_near + (255.0 - grey) / 254.0 * (depth_far - depth_near);
        if front[3] > SOLID && back[3] > SOLID {
            ensure!(metres < 4.5, "({x}, {y}): {metres} m away");
            hidden += 1;
        } else if front[3] == 0 && back[3] > SOLID {
            ensure!(metres > 4.5, "({x}, {y}): {metres} m away");
            free += 1;
        }
    }
    ensure!(hidden > 40 && free > 20, "{hidden} hidden, {free} free");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn people_of_splats_and_of_fields_hide_each_other() -> anyhow::Result<()> {
    let stage = Stage::new()?;
    let position = |near| if near { [0.26, 1.0] } else { [0.0, 0.0] };
    for ada_is_near in [true, false] {
        let ada = still("ada", "duo", position(ada_is_near));
        let bob = still("bob", "fog", position(!ada_is_near));
        let (near, far) = if ada_is_near {
            (&ada, &bob)
        } else {
            (&bob, &ada)
        };
        hides(&stage, near, far)
            .await
            .with_context(|| format!("{near} before {far}"))?;
    }
    let result = stage.result().await?;
    let client = YotoClient::connect(&stage.service.address).await?;
    let of = |model: String, step| format!("{model}/checkpoints/{step}");
    let duo = of(client.find_model("duo").await?.name, 40);
    let fog = of(client.find_model("fog").await?.name, 150);
    ensure!(
        result.checkpoint == duo && result.other_checkpoints == [fog],
        "{} {:?}",
        result.checkpoint,
        result.other_checkpoints
    );
    surroundings(&stage)?;
    refusals(&stage)
}

/// Both cast a shadow, and stand before what is behind them.
fn surroundings(stage: &Stage) -> anyhow::Result<()> {
    let (ada, bob) = (
        still("ada", "duo", [-0.8, 0.0]),
        still("bob", "fog", [0.8, 0.0]),
    );
    let mut scene = scene(&[&ada, &bob]);
    scene["camera"]["keys"][0]["eye"] = json!([0, 3, 4]);
    RgbaImage::from_pixel(8, 8, image::Rgba([200, 100, 50, 255]))
        .save(stage.dir.path().join("wall.png"))?;
    scene["backdrop"] = json!("wall.png");
    let mut shot = |shadow: bool, out: &str| {
        scene["shadow"] = json!(shadow);
        stage.render("duo", &scene, out, &[], succeed)?;
        let path = stage.dir.path().join(out).join("000000.png");
        anyhow::Ok(image::open(path)?.to_rgb8())
    };
    let (plain, shady) = (shot(false, "plain")?, shot(true, "shady")?);
    let mut dark = [0, 0];
    for (x, y, before) in plain.enumerate_pixels() {
        let after = shady.get_pixel(x, y).0;
        if before.0 == [200, 100, 50] && after[0] < 150 {
            dark[usize::from(x >= SIZE / 2)] += 1;
        }
    }
    ensure!(dark.iter().all(|it| *it > 5), "{dark:?} dark pixels");
    ensure!(plain.pixels().any(|it| it.0 != [200, 100, 50]), "nobody");
    Ok(())
}

fn refusals(stage: &Stage) -> anyhow::Result<()> {
    let ada = still("ada", "duo", [0.0; 2]);
    let bob = |change: &dyn Fn(&mut Value)| {
        let mut bob = still("bob", "fog", [0.8, 0.0]);
        change(&mut bob);
        bob
    };
    let lit = |of: Value| bob(&move |it| it["light"] = of.clone());
    let goal: &[&str] = &["--max-seconds-per-frame", "1"];
    let real: &[&str] = &["--quality", "realtime"];
    for (other, options, cause) in [
        (
            bob(&|it| it["model"] = json!("ice")),
            &[][..],
            "actors[1].model",
        ),
        (
            bob(&|it| it["subject"] = json!("ada")),
            &[],
            "scene.actors[1].subject: ada is not in fog",
        ),
        (
            lit(json!({"of": "ada"})),
            &[],
            "scene.actors[1].light.subject: ada is not in fog",
        ),
        (lit(json!("none")), &[], "only models of splats"),
        (bob(&|_| ()), goal, "people of several models"),
        (bob(&|_| ()), real, "fog: the model's tier, draft"),
    ] {
        let said = stage.render("duo", &scene(&[&ada, &other]), "no", options, fail)?;
        ensure!(said.contains(cause), "{said}, not {cause}");
    }
    let alone = scene(&[&bob(&|_| ())]);
    let said = stage.render("duo", &alone, "no", &[], fail)?;
    ensure!(
        said.contains("render the scene with the model of an actor"),
        "{said}"
    );
    ensure!(!Path::new(&stage.dir.path().join("no")).exists());
    Ok(())
}

//! Exports by a worker of the service: the same files as a local export, splats of a field, bad requests, and a
//! cancel.

use anyhow::{Context, ensure};
use serde_json::Value;
use std::path::PathBuf;
use std::time::Instant;
use yoto_client::YotoClient;
use yoto_proto::v1::{Distillation, ExportForm, ExportMotion, ExportSpec, Job, job};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::page::clips;
use yoto_tests::people::write_capture;
use yoto_tests::process::{PATIENCE, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 12;
const SIZE: u32 = 48;

type Run = fn(&str, &[&str]) -> anyhow::Result<String>;

/// A service with one person, in a model of splats and in one of fields.
struct Stage {
    dir: tempfile::TempDir,
    service: Service,
}

impl Stage {
    fn new() -> anyhow::Result<Self> {
        let dir = tempfile::tempdir()?;
        let person = &SyntheticPerson::cast(1, 7)[0];
        // The title has another name, so it is not compared.
        write_capture(person, FRAMES, SIZE, &dir.path().join("walk"))?;
        let service = Service::start(YOTO, &dir.path().join("data"), true)?;
        let stage = Self { dir, service };
        let walk = stage.at("walk");
        stage.yoto(&format!("subject add ada {walk}"), succeed)?;
        for (model, tier) in [("solo", "splat"), ("field", "draft")] {
            let line = format!("train {model} --subjects ada --tier {tier} --steps 20");
            stage.yoto(&line, succeed)?;
        }
        Ok(stage)
    }

    fn at(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn yoto(&self, line: &str, run: Run) -> anyhow::Result<String> {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", &self.service.address]);
        run(YOTO, &arguments)
    }

    fn read(&self, name: &str) -> anyhow::Result<Vec<u8>> {
        let path = self.path(name);
        std::fs::read(&path).with_context(|| path.display().to_string())
    }

    /// Exports by a worker, with JSON output.
    fn export(&self, line: &str) -> anyhow::Result<Value> {
        let said = self.yoto(&format!("export {line} --output json"), succeed)?;
        serde_json::from_str(&said).with_context(|| said)
    }
}

#[test]
fn a_worker_writes_what_this_disk_s_copy_of_the_model_does() -> anyhow::Result<()> {
    let stage = Stage::new()?;
    let (walk, model) = (stage.at("walk"), stage.at("model"));
    stage.yoto(&format!("model export solo --out {model}"), succeed)?;
    let mesh = "--triangles 500 --texture 64";
    for (name, options) in [
        ("a.html", format!("--capture {walk}")),
        ("a.spz", format!("--capture {walk} --frame 5")),
        ("rest.spz", String::new()),
        ("s.glb", "--format splats".into()),
        ("m.glb", format!("--capture {walk} {mesh}")),
        ("a.obj", format!("--capture {walk} --frame 5 {mesh}")),
        ("a.ply", format!("--format mesh {mesh}")),
    ] {
        let of =
            |folder: &str| format!("{options} --out {}", stage.at(&format!("{folder}/{name}")));
        let line = format!("solo --subject ada {}", of("job"));
        let told = stage.export(&line.replace("  ", " "))?;
        let bytes = stage.read(&format!("job/{name}"))?;
        ensure!(told["bytes"] == bytes.len(), "{told}");
        let line = format!("export {model} --slot 0 {}", of("disk"));
        let line = line.replace("  ", " ");
        succeed(YOTO, &line.split(' ').collect::<Vec<_>>())?;
        // The folder of a model knows no names of people.
        let disk = stage.read(&format!("disk/{name}"))?;
        let named = match name {
            "a.html" => String::from_utf8(disk)?
                .replace("slot 0", "ada")
                .into_bytes(),
            "m.glb" => renamed(&disk, "slot 0", "ada")?,
            _ => disk,
        };
        ensure!(bytes == named, "{name} differs");
    }
    for beside in ["a.mtl", "a.png"] {
        let [job, disk] = ["job", "disk"].map(|it| stage.read(&format!("{it}/{beside}")));
        ensure!(job? == disk?, "{beside} differs");
    }

    // The files with their media types, for other programs.
    let told = stage.export(&format!(
        "solo --subject ada --frame 5 --out {}",
        stage.at("own.spz")
    ))?;
    let job = &told["job"];
    let result = &job["result"]["export"];
    ensure!(result["files"][0]["file"] == "own.spz", "{told}");
    ensure!(told["splats"].as_u64().is_some_and(|it| it > 100), "{told}");
    ensure!(result["splats"] == told["splats"], "{told}");
    // The poses of the capture in the service are those of its folder.
    ensure!(stage.read("own.spz")? == stage.read("job/a.spz")?);
    let name = job["name"].as_str().context("a name")?;
    let fetch = format!("job fetch {name} --out {}", stage.at("fetched"));
    stage.yoto(&fetch, succeed)?;
    ensure!(stage.read("fetched/own.spz")? == stage.read("own.spz")?);
    ensure!(stage.yoto("job list", succeed)?.contains("export"));

    // Motions: the person's own, unless the order names others or none.
    for (options, expected) in [
        ("", vec![("ada", FRAMES)]),
        (" --no-motion", vec![("rest", 1)]),
        (
            " --motion ada --motion ada --range ..:2",
            vec![("ada", FRAMES / 2), ("ada (2)", FRAMES / 2)],
        ),
    ] {
        let out = stage.at("moves.html");
        let told = stage.export(&format!("solo --subject ada{options} --force --out {out}"))?;
        let file = &told["job"]["result"]["export"]["files"][0];
        ensure!(file["content_type"] == "text/html; charset=utf-8", "{told}");
        let found = clips(&String::from_utf8(stage.read("moves.html")?)?)?;
        let found: Vec<(&str, usize)> = found.iter().map(|it| (&*it.0, it.1)).collect();
        ensure!(found == expected, "{options}: {found:?}");
    }
    Ok(())
}

#[test]
fn splats_are_made_of_a_field_on_the_way() -> anyhow::Result<()> {
    let stage = Stage::new()?;
    let out = stage.at("ada.spz");
    let line = format!("field --subject ada --seconds 3 --size 64 --out {out}");
    let told = stage.export(&line)?;
    ensure!(stage.read("ada.spz")?.starts_with(b"\x1f\x8b"));
    let distilled = &told["job"]["result"]["export"]["distilled"];
    let pictures = distilled["pictures"].as_u64();
    ensure!(pictures.is_some_and(|it| it >= 12), "{told}");
    // A field of 20 steps is easy to learn.
    let psnr = told["psnr"].as_f64().context("no figure")?;
    ensure!(psnr > 15.0 && distilled["psnr"] == psnr, "{told}");
    // An export of a model of splats has no training.
    let line = format!(
        "export solo --subject ada --seconds 3 --out {}",
        stage.at("b.spz")
    );
    let said = stage.yoto(&line, fail)?;
    ensure!(said.contains("spec.export.distillation"), "{said}");
    ensure!(!stage.path("b.spz").exists());
    // A local export of a field is refused as well.
    let folder = stage.at("model");
    stage.yoto(&format!("model export field --out {folder}"), succeed)?;
    let said = stage.yoto(
        &format!("export {folder} --out {}", stage.at("b.spz")),
        fail,
    )?;
    ensure!(said.contains("draft, has no splats"), "{said}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_are_refused_by_field_and_exports_are_cancelled() -> anyhow::Result<()> {
    let stage = Stage::new()?;
    let client = YotoClient::connect(&stage.service.address).await?;
    let (model, field) = (
        client.find_model("solo").await?,
        client.find_model("field").await?,
    );
    let ada = client.find_subject("ada").await?;
    let good = ExportSpec {
        model: model.name.clone(),
        subject: ada.name.clone(),
        form: ExportForm::SplatsSpz.into(),
        ..ExportSpec::default()
    };
    type Change = fn(&mut ExportSpec);
    let cases: [(Change, &str); 9] = [
        (|it| it.form = 0, "spec.export.form"),
        (|it| it.form = 42, "spec.export.form"),
        (|it| it.subject = "ada".into(), "spec.export.subject"),
        (|it| it.subject = "subjects/none".into(), "subjects/none"),
        (|it| it.frame = Some(99), "spec.export.frame"),
        (|it| it.triangles = 500, "spec.export.triangles"),
        (
            |it| it.motions = vec![ExportMotion::default()],
            "spec.export.motions[0].motion",
        ),
        (|it| it.file = "../ada".into(), "spec.export.file"),
        (
            |it| {
                it.distillation = Some(Distillation {
                    seconds: -1.0,
                    size: 0,
                    ..Distillation::default()
                });
            },
            "spec.export.distillation.seconds",
        ),
    ];
    for (change, expected) in cases {
        let mut bad = good.clone();
        change(&mut bad);
        let refused = client.export(bad).await.err();
        let said = refused.context(expected)?.to_string();
        ensure!(said.contains(expected), "{expected}: {said}");
    }

    let lasting = |seconds: f64| ExportSpec {
        model: field.name.clone(),
        distillation: Some(Distillation {
            seconds,
            size: 64,
            ..Distillation::default()
        }),
        ..good.clone()
    };
    // Progress never decreases, from the first picture of the field to the files.
    let job = client.export(lasting(1.0)).await?.name;
    let mut done = Vec::new();
    let note = |job: &Job| done.extend(job.progress.as_ref().map(|it| it.fraction));
    client.wait_for_job(&job, note).await?;
    ensure!(done.is_sorted() && done.last() == Some(&1.0), "{done:?}");

    let job = client.export(lasting(3600.0)).await?.name;
    let began = Instant::now();
    loop {
        let now = client.get_job(&job).await?;
        let phase = now.progress.map(|it| it.phase).unwrap_or_default();
        if phase == "rendering the field" {
            break;
        }
        ensure!(began.elapsed() < PATIENCE, "it does not begin: {phase}");
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    client.cancel_job(&job).await?;
    let ended = client.wait_for_job(&job, |_| ()).await;
    ensure!(ended.is_err());
    ensure!(client.get_job(&job).await?.state() == job::State::Cancelled);
    ensure!(client.list_objects(&job).await?.is_empty());
    Ok(())
}

/// Gives a person another name, of another length, in a binary glTF.
fn renamed(glb: &[u8], from: &str, to: &str) -> anyhow::Result<Vec<u8>> {
    let length = u32::from_le_bytes(glb[12..16].try_into()?) as usize;
    let mut gltf = String::from_utf8(glb[20..20 + length].to_vec())?;
    gltf = gltf.trim_end().replace(from, to);
    while gltf.len() % 4 != 0 {
        gltf.push(' ');
    }
    let numbers = &glb[20 + length..];
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2u32.to_le_bytes());
    bytes.extend((20 + gltf.len() as u32 + numbers.len() as u32).to_le_bytes());
    bytes.extend((gltf.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(gltf.as_bytes());
    bytes.extend(numbers);
    Ok(bytes)
}

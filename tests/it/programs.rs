//! The command line for other programs: JSON, closed pipes, silence; and the pictures and figures that
//! a training leaves.

use anyhow::{Context, ensure};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, output, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 48;

fn json(text: &str) -> anyhow::Result<Value> {
    serde_json::from_str(text).with_context(|| text.to_owned())
}

#[test]
fn results_are_json_where_programs_read_them() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let at = |name: &str| dir.path().join(name).display().to_string();
    let person = &SyntheticPerson::cast(1, 7)[0];
    write_capture(person, 24, 2 * SIZE, &dir.path().join("ada"))?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    let read = |line: &str| json(&yoto(&format!("{line} --output json"), succeed)?);

    let added = read(&format!("subject add ada {}", at("ada")))?;
    ensure!(added["subject"]["state"] == "READY", "{added}");
    let preview = at("preview");
    let train = "train solo --subjects ada --tier draft --steps 30 --size 48";
    let trained = read(&format!("{train} --preview {preview}"))?;
    let result = &trained["job"]["result"]["train"];
    ensure!(
        result["image_size"] == SIZE && result["held_out"] == 1,
        "{result}"
    );
    for psnr in ["psnr", "psnr_mask_box"] {
        ensure!(result[psnr].as_f64().is_some_and(|it| it > 0.0), "{result}");
    }
    ensure!(trained["job"]["progress"]["fraction"] == 1.0, "{trained}");
    // A held-out frame beside its render.
    let pictures = trained["previews"].as_array().context("previews")?;
    let last = pictures.last().and_then(Value::as_str).context("one")?;
    ensure!(Path::new(last).ends_with("preview/000030.png"), "{last}");
    let sheet = image::open(last)?;
    ensure!((sheet.width(), sheet.height()) == (2 * SIZE + 4, SIZE));

    // Renders and evaluations use the best checkpoint, which is known by its own PSNR.
    let model = read("model show solo")?;
    let checkpoint = &model["checkpoints"][0];
    ensure!(checkpoint["psnr"] == result["psnr"], "{model}");
    ensure!(
        checkpoint["best"] == true && checkpoint["image_size"] == SIZE,
        "{model}"
    );
    ensure!(model["model"]["slots"][0]["trained"] == true, "{model}");

    // Size and speed of a training are those of the one before; figures say at which size they are.
    let again = read("train solo --steps 3")?;
    ensure!(
        again["job"]["result"]["train"]["image_size"] == SIZE,
        "{again}"
    );
    let measured = read("evaluate solo")?;
    let result = &measured["job"]["result"]["evaluate"];
    ensure!(result["image_size"] == SIZE, "{measured}");
    ensure!(measured["scores"][0]["of"] == "ada", "{measured}");
    let said = yoto("evaluate solo", succeed)?;
    ensure!(said.contains("held-out frames, 48 pixels"), "{said}");

    let status = read("status")?;
    // One lane for trainings, and one for all other jobs.
    let workers = status["status"]["workers"].as_array().context("workers")?;
    let names: Vec<_> = workers.iter().map(|it| &it["display_name"]).collect();
    ensure!(names == ["embedded", "embedded trainer"], "{status}");
    let jobs = read("job list --state succeeded --limit 2")?;
    let jobs = jobs["jobs"].as_array().context("jobs")?;
    ensure!(jobs.len() == 2 && jobs[0]["spec"]["evaluate"].is_object());
    // The start of an id stands for it.
    let name = jobs[0]["name"].as_str().context("a name")?;
    let short = name
        .strip_prefix("jobs/")
        .and_then(|id| id.get(..8))
        .context("an id")?;
    let shown = read(&format!("job show {short}"))?;
    ensure!(shown["job"]["name"] == name, "{shown}");
    ensure!(
        shown["job"]["attempts"][0]["outcome"] == "SUCCEEDED",
        "{shown}"
    );

    // A transparent picture has the person's opacity, and no other file.
    let rendered = read(&format!(
        "render solo --subject ada --orbit 0 --views 1 --size 32 --transparent --out {}",
        at("clear")
    ))?;
    let file = rendered["files"][0].as_str().context("a file")?;
    ensure!(image::open(file)?.color() == image::ColorType::Rgba8);

    // Errors are JSON as well.
    let line = "render solo --subject ada --orbit 99 --out o --output json --server";
    let mut arguments: Vec<&str> = line.split(' ').collect();
    arguments.push(&service.address);
    let failed = output(YOTO, &arguments)?;
    let error = json(&String::from_utf8(failed.stdout)?)?["error"].clone();
    let error = error.as_str().context("says why")?;
    ensure!(
        !failed.status.success() && error.contains("frames 0 to 23, not 99"),
        "{error}"
    );
    ensure!(
        error.matches("frames 0 to 23").count() == 1,
        "said once: {error}"
    );
    let said = yoto(&format!("subject add ada {}", at("ada")), fail)?;
    ensure!(said.contains("--again"), "{said}");
    yoto(&format!("subject add ada {} --again", at("ada")), succeed)?;
    ensure!(
        read("subject show ada")?["captures"]
            .as_array()
            .map(Vec::len)
            == Some(2)
    );

    let quiet = [
        "subject",
        "add",
        "bob",
        &at("ada"),
        "--quiet",
        "--server",
        &service.address,
    ];
    let quiet = output(YOTO, &quiet)?;
    ensure!(
        quiet.status.success() && quiet.stderr.is_empty(),
        "{quiet:?}"
    );
    Ok(())
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() -> anyhow::Result<()> {
    let mut child = Command::new(YOTO)
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    drop(child.stdout.take());
    let ended = child.wait_with_output()?;
    let said = String::from_utf8_lossy(&ended.stderr);
    ensure!(
        ended.status.success() && said.is_empty(),
        "{}: {said}",
        ended.status
    );
    Ok(())
}

//! Measured trade-offs, and renders by quality.

use anyhow::Context;
use serde_json::Value;
use std::path::Path;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::{write_capture, write_capture_with_held_out};
use yoto_tests::process::{Service, fail, output, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const LAB: &str = env!("CARGO_BIN_EXE_yoto-lab-under-test");

fn text(path: &Path) -> anyhow::Result<&str> {
    path.to_str().context("a plain path")
}

fn read_json(path: &Path) -> anyhow::Result<Value> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    Ok(serde_json::from_slice(&bytes)?)
}

/// `chosen: …` and `promised …`, from the command's standard error.
fn told(arguments: &[&str]) -> anyhow::Result<String> {
    let output = output(YOTO, arguments)?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    anyhow::ensure!(output.status.success(), "{arguments:?}: {said}");
    Ok(said)
}

#[test]
fn renders_say_what_they_want_once_a_model_is_measured() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let capture = dir.path().join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 16, 32, &capture)?;
    let server = ["--server", service.address.as_str()];
    let line = |words: &[&'static str], more: &[&str]| -> Vec<String> {
        let all = words.iter().copied().chain(more.iter().copied());
        all.chain(server).map(str::to_owned).collect()
    };
    let with = |words: &[&'static str],
                more: &[&str],
                run: fn(&str, &[&str]) -> anyhow::Result<String>| {
        let line = line(words, more);
        run(YOTO, &line.iter().map(String::as_str).collect::<Vec<_>>())
    };
    with(
        &["subject", "add", "ada", "--capture"],
        &[text(&capture)?],
        succeed,
    )?;
    let train = [
        "train",
        "solo",
        "--subjects",
        "ada",
        "--tier",
        "draft",
        "--steps",
        "60",
    ];
    with(&train, &[], succeed)?;

    let pictures = dir.path().join("pictures");
    let own_motion = [
        "render",
        "solo",
        "--subject",
        "ada",
        "--motion",
        "ada",
        "--frames",
        "0..6:2",
    ];
    // Each render replaces the one before.
    let to = ["--size", "32", "--force", "--out", text(&pictures)?];
    let wish = |wanted: [&'static str; 2]| [&wanted[..], &to].concat();
    let said = with(&own_motion, &wish(["--quality", "fast"]), fail)?;
    assert!(said.contains("yoto tradeoff solo"), "{said}");

    let out = dir.path().join("tradeoff");
    let measure = [
        "tradeoff",
        "--model",
        "solo",
        "--views",
        "1",
        "--repeats",
        "1",
        "--out",
    ];
    let said = with(&measure, &[text(&out)?], succeed)?;
    assert!(said.contains("rendered  draft"), "{said}");
    let report = read_json(&out.join("tradeoff.json"))?;
    let points = report["rendering"][0]["points"]
        .as_array()
        .context("points")?;
    assert_eq!(points[0]["settings"]["scale"], 1.0);
    assert_eq!(points[0]["psnr_to_full"], 100.0);
    let best = points.iter().filter_map(|it| it["psnr"].as_f64());
    let best = best.fold(0.0, f64::max);
    let csv = std::fs::read_to_string(out.join("tradeoff.csv"))?;
    let cells: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(cells, vec![cells[0]; points.len() + 1], "{csv}");
    let said = with(&["model", "show", "solo"], &[], succeed)?;
    assert!(said.contains("trade-off measured"), "{said}");

    let choose = |wanted: [&'static str; 2]| {
        let line = line(&own_motion, &wish(wanted));
        told(&line.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let said = choose(["--quality", "full"])?;
    assert!(said.contains("chosen: 32 samples per ray"), "{said}");
    assert!(said.contains("100 % of the resolution"), "{said}");
    // The person's own motion has ground truth.
    assert!(said.contains("dB on 3 pictures"), "{said}");
    let said = choose(["--max-seconds-per-frame", "1000"])?;
    assert!(
        said.contains(&format!("{best:.2} dB")),
        "the best for any time: {said}"
    );
    assert!(pictures.join("000002.png").exists());
    let said = with(&own_motion, &wish(["--min-psnr", "90"]), fail)?;
    assert!(
        said.contains("quality.min_psnr_db") && said.contains(&format!("{best:.2} dB")),
        "{said}"
    );

    // Without a measurement there are no predictions.
    with(&["train", "solo", "--steps", "5"], &[], succeed)?;
    let said = with(&own_motion, &wish(["--quality", "fast"]), fail)?;
    assert!(said.contains("NO_TRADEOFF"), "{said}");
    Ok(())
}

#[test]
fn tiers_and_budgets_are_compared_on_captures() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join("ada");
    write_capture_with_held_out(&SyntheticPerson::cast(1, 7)[0], 10, 32, &capture)?;
    let out = dir.path().join("out");
    let said = succeed(
        LAB,
        &[
            "tradeoff",
            "--capture",
            text(&capture)?,
            "--tiers",
            "draft",
            "--budgets",
            "2,0.2",
            "--size",
            "24",
            "--views",
            "1",
            "--repeats",
            "1",
            "--out",
            text(&out)?,
        ],
    )?;
    assert_eq!(said.matches("trained   draft").count(), 2, "{said}");
    let report = read_json(&out.join("tradeoff.json"))?;
    let trained = report["training"].as_array().context("training")?;
    let budgets: Vec<f64> = trained
        .iter()
        .filter_map(|it| it["budget_seconds"].as_f64())
        .collect();
    assert_eq!(budgets, [0.2, 2.0], "shortest first");
    for it in trained {
        assert!(it["checkpoint_bytes"].as_u64() > Some(1000), "{it}");
        let score = &it["scores"]["novel_view"];
        assert!(score["psnr"].as_f64() > Some(5.0), "{it}");
        if cfg!(target_os = "linux") {
            assert!(it["peak_memory_bytes"].as_u64() > Some(1 << 20), "{it}");
        }
    }
    assert!(trained[1]["steps"].as_u64() > trained[0]["steps"].as_u64());
    Ok(())
}

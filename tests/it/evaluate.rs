//! Measurements of models: the service's evaluate job, a model folder, and the ablation.

use anyhow::Context;
use serde_json::Value;
use std::path::Path;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::{write_capture, write_capture_with_held_out};
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const LAB: &str = env!("CARGO_BIN_EXE_yoto-lab-under-test");

fn text(path: &Path) -> anyhow::Result<&str> {
    path.to_str().context("a plain path")
}

/// The cells of the table's line that starts with `name`.
fn cells<'a>(table: &'a str, name: &str) -> anyhow::Result<Vec<&'a str>> {
    let line = table.lines().find(|line| line.starts_with(name));
    let line = line.with_context(|| format!("no line of {name} in\n{table}"))?;
    let rest = line.strip_prefix(name).unwrap_or_default();
    Ok(rest.split_whitespace().collect())
}

fn figure(cell: &str) -> anyhow::Result<f64> {
    let bare = cell.trim_matches(['(', ')']);
    bare.parse().with_context(|| format!("{cell} is no figure"))
}

/// PICTURES PSNR BOX SSIM SSIM-7 (SSIM-7/2) LPIPS BLACK, in this order, of a trained model.
fn check_row(table: &str, name: &str, pictures: usize) -> anyhow::Result<Vec<f64>> {
    let cells = cells(table, name)?;
    assert_eq!(cells.len(), 8, "{name} in\n{table}");
    assert_eq!(cells[6], "-", "LPIPS needs weights that were not given");
    let figures: Vec<f64> = [0, 1, 2, 3, 4, 5, 7]
        .iter()
        .map(|&i| figure(cells[i]))
        .collect::<anyhow::Result<_>>()?;
    let [count, psnr, in_box, ssim, uniform, inflated, black] = figures[..] else {
        anyhow::bail!("{figures:?}");
    };
    assert_eq!(count as usize, pictures, "{name}");
    assert!(psnr > black, "{name}: {psnr} dB, a black picture {black}");
    assert!(in_box < psnr, "{name}: {in_box} dB in the box");
    assert!((0.0..1.0).contains(&ssim) && (0.0..1.0).contains(&uniform));
    assert!(inflated > uniform, "{name}: {inflated} and {uniform}");
    Ok(figures)
}

#[test]
fn the_service_measures_frames_that_training_leaves_out() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let server = service.address.as_str();
    let yoto = |line: &str| {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", server]);
        succeed(YOTO, &arguments)
    };
    let refused = |line: &str| {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", server]);
        fail(YOTO, &arguments)
    };
    for (person, name) in SyntheticPerson::cast(2, 7).iter().zip(["ada", "bob"]) {
        let capture = dir.path().join(name);
        // Frames 10 and 30 are left out of training.
        write_capture(person, 32, 32, &capture)?;
        yoto(&format!("subject add {name} --capture {}", text(&capture)?))?;
    }
    yoto("model create duo --subjects ada,bob --tier draft")?;
    assert!(refused("evaluate duo")?.contains("NO_CHECKPOINT"));
    yoto("train duo --steps 120 --seed 3")?;

    let said = yoto("evaluate duo --table")?;
    assert!(said.contains("/checkpoints/120: held-out frames"), "{said}");
    let ada = check_row(&said, "ada", 2)?;
    let bob = check_row(&said, "bob", 2)?;
    let mean = check_row(&said, "mean", 4)?;
    assert!((mean[1] - (ada[1] + bob[1]) / 2.0).abs() < 0.011, "{said}");
    // The paper's table: ours, then the published figures.
    let row = cells(&said, "yoto")?;
    assert!((figure(row[1])? - mean[1]).abs() < 0.011, "{said}");
    assert_eq!(row[row.len() - 3..], ["30.51", "0.9588", "30.20"]);
    assert_eq!(cells(&said, "humannerf")?[1], "-");

    // The same figures in one page.
    let page = dir.path().join("duo.html");
    yoto(&format!("report duo --out {}", text(&page)?))?;
    let page = std::fs::read_to_string(page)?;
    let measured = [format!("<td>{:.2}</td>", mean[1]), "30.51".to_owned()];
    for part in measured
        .iter()
        .map(String::as_str)
        .chain(["ada", "bob", "data:image/png;base64,"])
    {
        assert!(page.contains(part), "no {part}");
    }

    let said = yoto("evaluate duo --subjects bob --size 24")?;
    check_row(&said, "bob", 2)?;
    assert!(cells(&said, "ada").is_err(), "ada was not requested");

    let said = refused("evaluate duo --protocol zju-all")?;
    assert!(said.contains("spec.evaluate.protocol"), "{said}");
    assert!(yoto("job list")?.contains("evaluate"));
    Ok(())
}

#[test]
fn a_capture_without_held_out_frames_is_named() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let with = |line: &str, run: Run| service.ask(YOTO, line, run);
    let capture = dir.path().join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 24, &capture)?;
    let add = format!("subject add ada --capture {}", text(&capture)?);
    with(&add, succeed)?;
    with("train solo --subjects ada --tier draft --steps 3", succeed)?;
    let said = with("evaluate solo", fail)?;
    assert!(
        said.contains("NO_HELD_OUT") && said.contains("fewer than 11 frames"),
        "{said}"
    );
    Ok(())
}

#[test]
fn the_ablation_compares_four_variants_and_leaves_models_to_measure() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let mut captures = Vec::new();
    for (person, name) in SyntheticPerson::cast(2, 7).iter().zip(["ada", "bob"]) {
        let capture = dir.path().join(name);
        write_capture_with_held_out(person, 10, 32, &capture)?;
        captures.push(capture);
    }
    let (ada, bob) = (text(&captures[0])?, text(&captures[1])?);
    let out = dir.path().join("out");
    let run = [
        "ablation",
        "--capture",
        ada,
        bob,
        "--steps",
        "101",
        "--size",
        "24",
        "--tier",
        "draft",
        "--pictures",
        "2",
        "--out",
        text(&out)?,
    ];
    let said = succeed(LAB, &run)?;
    let json = std::fs::read(out.join("ablation.json"))?;
    let report: Value = serde_json::from_slice(&json)?;
    assert_eq!(report["captures"], serde_json::json!(["ada", "bob"]));
    assert_eq!(report["budget_steps"], 101);
    let variants = report["variants"].as_array().context("variants")?;
    let of = |key: &str| -> Vec<&Value> { variants.iter().map(|it| &it[key]).collect() };
    assert_eq!(
        of("variant"),
        ["yoto", "no-pose-condition", "no-identity", "humannerf"]
    );
    // One model per person, the same steps in total.
    assert_eq!(of("models"), [1, 1, 1, 2]);
    assert_eq!(of("steps"), [101; 4]);
    for variant in variants {
        let name = variant["variant"].as_str().context("a name")?;
        for (split, column) in [("novel_view", 1), ("novel_pose", 5)] {
            let score = &variant["mean"][split];
            assert_eq!(score["pictures"], 4, "{name} {split}");
            let psnr = score["psnr"].as_f64().context("psnr")?;
            let black = score["black_psnr"].as_f64().context("black_psnr")?;
            assert!(psnr > black, "{name} {split}: {psnr} dB, black {black}");
            let printed = figure(cells(&said, name)?[column])?;
            assert!((printed - psnr).abs() < 0.006, "{name} {split}\n{said}");
        }
    }
    assert!(said.contains("over no-identity"), "{said}");

    // A second measurement of the trained model gives the same figures.
    let model = out.join("models/yoto");
    let measure = [
        "evaluate",
        "--model-dir",
        text(&model)?,
        "--capture",
        ada,
        bob,
        "--size",
        "24",
        "--pictures",
        "2",
        "--table",
    ];
    let said = succeed(LAB, &measure)?;
    let view = check_row(&said, "mean, held-out views", 4)?;
    check_row(&said, "mean, held-out poses", 4)?;
    let before = variants[0]["mean"]["novel_view"]["psnr"].as_f64();
    assert!((view[1] - before.context("psnr")?).abs() < 0.006, "{said}");

    let by = |protocol: &'static str| [&measure[..], &["--protocol", protocol]].concat();
    // Black outside the box in both pictures, and only frame 0: 5 is not a multiple of 30.
    let said = succeed(LAB, &by("zju-step30"))?;
    check_row(&said, "mean, held-out views", 2)?;
    let swapped = [&measure[..4], &[bob, ada]].concat();
    let said = fail(LAB, &swapped)?;
    assert!(
        said.contains("slot 0 of the model is not the body"),
        "{said}"
    );
    let said = fail(LAB, &by("snapshot"))?;
    assert!(said.contains("visual comparison"), "{said}");
    Ok(())
}

//! The demo and the quality measurement, at small sizes.

use anyhow::Context;
use serde_json::Value;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture_with_held_out;
use yoto_tests::process::{fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const LAB: &str = env!("CARGO_BIN_EXE_yoto-lab-under-test");

fn read(path: &std::path::Path) -> anyhow::Result<Value> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    Ok(serde_json::from_slice(&bytes)?)
}

fn number(value: &Value, path: &str) -> f64 {
    value
        .pointer(path)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{path} is no number in {value}"))
}

#[test]
fn the_demo_leaves_pictures_and_figures() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let out = dir.path().join("demo");
    let out_text = out.to_str().context("a path")?;
    let small = [
        "demo",
        "--out",
        out_text,
        "--subjects",
        "2",
        "--size",
        "48",
        "--seconds",
        "8",
    ];
    let said = succeed(YOTO, &small)?;
    let report = read(&out.join("report.json"))?;
    let sent = std::fs::read_to_string(out.join("report.html"))?;
    assert!(sent.contains("data:image/") && !sent.contains("<script"));
    let people = report["subjects"].as_array().context("subjects")?;
    assert_eq!(people.len(), 2);
    for person in people {
        for split in ["novel_view", "novel_pose"] {
            let psnr = number(person, &format!("/{split}/psnr"));
            let black = number(person, &format!("/{split}/black_psnr"));
            assert!(
                psnr > black + 1.0,
                "{split}: {psnr} dB, a black picture {black}"
            );
            assert!((0.0..=1.0).contains(&number(person, &format!("/{split}/ssim"))));
            assert!(number(person, &format!("/{split}/psnr_mask_box")) < psnr);
        }
        let name = person["name"].as_str().context("a name")?;
        assert!(said.contains(name), "the table names {name}");
        assert!(out.join(format!("orbit-{name}-animation.png")).is_file());
        let orbit = std::fs::read_dir(out.join(format!("orbit-{name}")))?.count();
        assert!(orbit >= 12, "{orbit} pictures of an orbit");
    }
    for field in [
        "steps",
        "train_seconds",
        "steps_per_second",
        "parameters",
        "checkpoint_bytes",
        "render_seconds_per_frame",
    ] {
        assert!(number(&report, &format!("/{field}")) > 0.0, "{field}");
    }
    assert!(
        report["device"]
            .as_str()
            .is_some_and(|device| !device.is_empty())
    );
    assert_eq!(report["objective"].as_str(), Some("l1+ssim"));
    for picture in ["contact-sheet.png", "motion-transfer.png"] {
        image::open(out.join(picture)).with_context(|| picture.to_owned())?;
    }
    // A second demo replaces the first's service.
    succeed(
        YOTO,
        &[
            "demo",
            "--out",
            out_text,
            "--subjects",
            "1",
            "--size",
            "32",
            "--seconds",
            "1",
        ],
    )?;
    Ok(())
}

#[test]
fn quality_measures_views_and_poses_along_the_way() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join("ada");
    write_capture_with_held_out(&SyntheticPerson::cast(1, 7)[0], 10, 48, &capture)?;
    let (capture, out) = (
        capture.to_str().context("a path")?,
        dir.path().join("report.json"),
    );
    let out_text = out.to_str().context("a path")?;
    let run = [
        "quality",
        "--capture",
        capture,
        "--size",
        "32",
        "--seconds",
        "3",
        "--tier",
        "draft",
        "--out",
        out_text,
    ];
    succeed(LAB, &run)?;
    let report = read(&out)?;
    for split in ["novel_view", "novel_pose"] {
        let curve = report["curve"][split]
            .as_array()
            .with_context(|| format!("curve of {split}"))?;
        assert!(curve.len() >= 3, "{} points", curve.len());
        let seconds: Vec<f64> = curve
            .iter()
            .map(|point| number(point, "/seconds"))
            .collect();
        assert!(seconds.is_sorted() && seconds[0] > 0.0, "{seconds:?}");
        assert!(number(&curve[curve.len() - 1], "/step") > number(&curve[0], "/step"));
        assert!(number(&report["subjects"][0], &format!("/{split}/psnr")) > 5.0);
    }
    let said = fail(
        LAB,
        &[
            "quality",
            "--capture",
            capture,
            "--tier",
            "golden",
            "--out",
            out_text,
        ],
    )?;
    assert!(
        said.contains("golden") && said.contains("balanced"),
        "{said}"
    );
    Ok(())
}

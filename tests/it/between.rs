//! Renders of mixtures of two people.

use anyhow::{Context, ensure};
use image::RgbImage;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 48;

/// Mean difference of two pictures, in levels.
fn apart(a: &RgbImage, b: &RgbImage) -> f64 {
    let pairs = a.as_raw().iter().zip(b.as_raw());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.as_raw().len() as f64
}

#[test]
fn a_row_of_mixtures_goes_from_one_to_the_other() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    for (person, name) in SyntheticPerson::cast(2, 7).iter().zip(["ada", "bob"]) {
        let capture = dir.path().join(name);
        write_capture(person, 24, SIZE, &capture)?;
        let folder = capture.to_str().context("a path in UTF-8")?;
        yoto(&format!("subject add {name} --capture {folder}"), succeed)?;
    }
    let pictures =
        |model: &str, what: &str, out: &str, count: usize| -> anyhow::Result<Vec<RgbImage>> {
            let out = dir.path().join(out);
            let folder = out.to_str().context("a path in UTF-8")?;
            yoto(
                &format!("render {model} {what} --orbit 3 --views 1 --size 48 --out {folder}"),
                succeed,
            )?;
            let files = (0..count).map(|i| out.join(format!("{i:06}.png")));
            let read = files.map(|file| Ok(image::open(file)?.into_rgb8()));
            read.collect()
        };
    yoto(
        "train duo --subjects ada,bob --tier draft --steps 150",
        succeed,
    )?;
    let row = pictures("duo", "--between ada,bob:0..1:5", "row", 5)?;
    let ada = &pictures("duo", "--subject ada", "ada", 1)?[0];
    ensure!(apart(&row[0], ada) < 1.0, "{}", apart(&row[0], ada));
    let (first, last) = (&row[0], &row[4]);
    let whole = apart(first, last);
    ensure!(whole > 3.0, "{whole}");
    // Each is more different from the first than the previous one.
    let far: Vec<f64> = row.iter().map(|it| apart(first, it)).collect();
    ensure!(far.is_sorted(), "{far:?}");
    let middle = &pictures("duo", "--between ada,bob:0.5", "middle", 1)?[0];
    ensure!(apart(middle, &row[2]) == 0.0);

    let out = dir.path().join("o");
    let out = out.to_str().context("a path in UTF-8")?;
    let line = format!("render duo --between ada,nobody:0.5 --orbit 3 --out {out}");
    let said = yoto(&line, fail)?;
    ensure!(said.contains("nobody"), "{said}");
    yoto(
        "train splats --subjects ada,bob --tier splat --steps 20",
        succeed,
    )?;
    let row = pictures("splats", "--between ada,bob:0..1:3", "splats", 3)?;
    let ada = &pictures("splats", "--subject ada", "ada-of-splats", 1)?[0];
    ensure!(apart(&row[0], ada) < 1.0, "{}", apart(&row[0], ada));
    let far: Vec<f64> = row.iter().map(|it| apart(&row[0], it)).collect();
    ensure!(far[1] > 0.5 && far[2] > far[1], "{far:?}");
    Ok(())
}

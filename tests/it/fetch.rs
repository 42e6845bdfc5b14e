//! Results of jobs are fetched later, and existing files are not replaced without the option.

use anyhow::{Context, ensure};
use image::AnimationDecoder;
use image::codecs::png::PngDecoder;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::Command;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Process, Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const LAB: &str = env!("CARGO_BIN_EXE_yoto-lab-under-test");
const FRAMES: usize = 12;
const SIZE: u32 = 48;

/// Seconds that each frame of an animated PNG is shown.
fn pace(path: &Path) -> anyhow::Result<Vec<f64>> {
    let file = BufReader::new(File::open(path).with_context(|| path.display().to_string())?);
    let frames = PngDecoder::new(file)?.apng()?.into_frames();
    let delays = frames.map(|frame| {
        let (above, below) = frame?.delay().numer_denom_ms();
        Ok(f64::from(above) / f64::from(below) / 1e3)
    });
    delays.collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn results_are_fetched_later_and_replace_nothing_unasked() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let at = |name: &str| dir.path().join(name).display().to_string();
    write_capture(
        &SyntheticPerson::cast(1, 7)[0],
        FRAMES,
        SIZE,
        &dir.path().join("ada"),
    )?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    yoto(&format!("subject add ada {}", at("ada")), succeed)?;
    yoto("train solo --subjects ada --tier draft --steps 4", succeed)?;

    // A motion keeps its speed when frames are skipped.
    let dance = format!(
        "render solo --subject ada --motion ada --animate --size 32 --out {}",
        at("dance")
    );
    yoto(&format!("{dance} --range 0..12:3"), succeed)?;
    let shown = pace(&dir.path().join("dance/animation.png"))?;
    ensure!(
        shown.len() == 4 && shown.iter().all(|it| (it - 0.2).abs() < 1e-3),
        "{shown:?}"
    );
    let said = yoto(&dance, fail)?;
    ensure!(
        said.contains("000000.png is there already") && said.contains("--force"),
        "{said}"
    );
    yoto(&format!("{dance} --range 0..3 --fps 10 --force"), succeed)?;
    let shown = pace(&dir.path().join("dance/animation.png"))?;
    ensure!(
        shown.len() == 3 && shown.iter().all(|it| (it - 0.1).abs() < 1e-3),
        "{shown:?}"
    );

    // Ctrl-C says how to come back; the second one ends the program, not the job.
    let orbit = format!(
        "render solo --subject ada --orbit 0 --views 600 --size 64 --out {}",
        at("orbit")
    );
    let mut arguments: Vec<&str> = orbit.split(' ').collect();
    arguments.extend(["--server", &service.address]);
    let mut watcher = Process::start(YOTO, &arguments)?;
    let line = watcher.line_with("runs as jobs/")?;
    let job = line.rsplit(' ').next().context("a job")?.to_owned();
    let interrupt = |process: &Process| {
        let id = process.id().to_string();
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .context("kill")
    };
    interrupt(&watcher)?;
    let line = watcher.line_with("it goes on as jobs/")?;
    ensure!(line.contains(&format!("yoto job fetch {job}")), "{line}");
    interrupt(&watcher)?;
    let status = watcher.wait()?;
    ensure!(status.code() == Some(130), "{status}");
    ensure!(!dir.path().join("orbit").exists());
    yoto(&format!("job fetch {job} --out {}", at("orbit")), succeed)?;
    ensure!(std::fs::read_dir(dir.path().join("orbit"))?.count() == 600);
    image::open(dir.path().join("orbit/000599.png"))?;
    // Existing files are not fetched again, and different ones are not replaced.
    std::fs::remove_file(dir.path().join("orbit/000007.png"))?;
    yoto(&format!("job fetch {job} --out {}", at("orbit")), succeed)?;
    image::open(dir.path().join("orbit/000007.png"))?;
    std::fs::write(dir.path().join("orbit/000007.png"), "mine")?;
    let said = yoto(&format!("job fetch {job} --out {}", at("orbit")), fail)?;
    ensure!(said.contains("000007.png is there already"), "{said}");

    // A model is exported from the service.
    yoto(&format!("model export solo --out {}", at("model")), succeed)?;
    let frame = at("frame.png");
    let local = format!(
        "render-frame --model-dir {} --capture {} --camera train --frame 0 --out {frame}",
        at("model"),
        at("ada")
    );
    succeed(LAB, &local.split(' ').collect::<Vec<_>>())?;
    image::open(frame)?;
    let said = yoto(
        &format!("model export solo --checkpoint 3 --out {}", at("none")),
        fail,
    )?;
    ensure!(said.contains("checkpoints/3 does not exist"), "{said}");
    Ok(())
}

//! `yoto avatar` as a user runs it: from a clip to a page.

use anyhow::{Context, ensure};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use yoto_synthetic::SyntheticPerson;

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");

/// Runs `yoto` in `folder`, without any of this machine's settings.
fn yoto(folder: &Path, line: &str) -> anyhow::Result<Output> {
    Command::new(YOTO)
        .args(line.split_whitespace())
        .current_dir(folder)
        .env_remove("YOTO_POSE_MODEL")
        .env_remove("YOTO_SMPL")
        .env_remove("RUST_LOG")
        .output()
        .with_context(|| line.to_owned())
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A synthetic person's capture in `folder`.
fn example(folder: &Path) -> anyhow::Result<PathBuf> {
    let made = yoto(
        folder,
        "capture example --people 1 --frames 24 --size 128 --out captures",
    )?;
    ensure!(made.status.success(), "{}", said(&made));
    let name = String::from_utf8_lossy(&made.stdout).trim().to_owned();
    Ok(PathBuf::from(name))
}

/// Most lines that a run prints by default.
const MOST_LINES: usize = 12;

/// Moves the person in all frames of a capture to `x`, metres, where no mask is.
fn moved(capture: &Path, x: f64) -> anyhow::Result<()> {
    let path = capture.join("poses.json");
    let mut poses: Value = serde_json::from_slice(&std::fs::read(&path)?)?;
    for frame in poses["frames"].as_array_mut().context("frames")? {
        frame["translation"][0] = x.into();
    }
    Ok(std::fs::write(&path, serde_json::to_vec(&poses)?)?)
}

#[test]
fn a_capture_becomes_a_page_with_pictures_and_figures() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = example(dir.path())?;
    let line = format!(
        "avatar {} --name ada --size 48 --seconds 3 --no-progress --out out/ada",
        capture.display()
    );
    let made = yoto(dir.path(), &line)?;
    ensure!(made.status.success(), "{}", said(&made));
    let all = said(&made) + &String::from_utf8_lossy(&made.stdout);
    ensure!(all.lines().count() <= MOST_LINES, "{all}");
    ensure!(all.contains("quality (PSNR"), "{all}");
    let out = dir.path().join("out/ada");
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json"))?)?;
    ensure!(report["frames"] == 24, "{report:#}");
    ensure!(report["training"]["steps"].as_u64() > Some(0), "{report:#}");
    let page = std::fs::read_to_string(out.join("index.html"))?;
    for kind in ["orbit", "motion"] {
        let pictures = report[kind].as_array().context("pictures")?;
        ensure!(pictures.len() >= 24, "{report:#}");
        for picture in pictures {
            let name = picture.as_str().context("a name")?;
            ensure!(
                kind == "motion" || page.contains(name),
                "{name} is not shown"
            );
            ensure!(image::open(out.join(name))?.width() == 48, "{name}");
        }
        ensure!(page.contains("motion.png") && out.join(format!("{kind}.png")).is_file());
    }
    ensure!(!page.contains(REFRESH), "the final page stays as it is");
    ensure!(page.contains("check/sheet.png") && out.join("check/sheet.png").is_file());

    // A run that fails keeps the files of an earlier one.
    let failed = yoto(dir.path(), "avatar nothing.mp4 --out out/ada")?;
    ensure!(!failed.status.success() && image::open(out.join("orbit.png")).is_ok());
    let itself = yoto(dir.path(), "avatar out/ada/capture --out out/ada")?;
    ensure!(
        said(&itself).contains("choose another --out"),
        "{}",
        said(&itself)
    );
    ensure!(out.join("capture/poses.json").is_file());
    // A folder that the program did not make is refused.
    for folder in ["capture", "check", "pictures", "service"] {
        std::fs::remove_file(out.join(folder).join("made-by-yoto-avatar"))?;
    }
    let again = yoto(dir.path(), &line)?;
    ensure!(!again.status.success() && said(&again).contains("was not made by"));
    Ok(())
}

#[test]
fn a_doubtful_capture_says_little_and_the_log_says_all() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = example(dir.path())?;
    let line = format!(
        "avatar {} --range ..6 --size 32 --seconds 2 --no-progress --out o",
        capture.display()
    );
    let made = yoto(dir.path(), &line)?;
    let said = said(&made);
    ensure!(made.status.success(), "{said}");
    let results = String::from_utf8_lossy(&made.stdout).into_owned();
    let lines: Vec<&str> = said.lines().chain(results.lines()).collect();
    ensure!(lines.len() <= MOST_LINES, "{lines:#?}");
    for start in [
        "found: the person in 6 frames (the clip has 24)",
        "doubtful: view coverage, ",
        "missing: the ",
        "next time: turn once, slowly",
        "training of ",
        "o/index.html",
        "o/play.html",
    ] {
        let is_said = lines.iter().any(|line| line.starts_with(start));
        ensure!(is_said, "{start}: {lines:#?}");
    }
    let page = std::fs::read_to_string(dir.path().join("o/index.html"))?;
    ensure!(page.contains("href=\"report.html\""), "{page}");
    let sent = std::fs::read_to_string(dir.path().join("o/report.html"))?;
    ensure!(
        sent.contains("data:image/") && !sent.contains("<script"),
        "{sent}"
    );
    let log = std::fs::read_to_string(dir.path().join("o/log.txt"))?;
    for detail in ["  pass  joints in the mask", "computing on", "note: "] {
        ensure!(log.contains(detail), "{detail}: {log}");
        ensure!(!said.contains(detail), "{detail}: {said}");
    }
    for line in lines {
        ensure!(log.contains(line), "{line}: {log}");
    }
    let report: Value = serde_json::from_slice(&std::fs::read(dir.path().join("o/report.json"))?)?;
    let lacks = report["lacks"].as_array().context("lacks")?;
    ensure!(!lacks.is_empty(), "{report:#}");
    Ok(())
}

#[test]
fn a_quiet_run_prints_results_and_errors_alone() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = example(dir.path())?;
    let options = "--quiet --output json --out o";
    let line = format!(
        "avatar {} --range ..6 --size 32 --seconds 2 {options}",
        capture.display()
    );
    let made = yoto(dir.path(), &line)?;
    ensure!(made.status.success() && made.stderr.is_empty(), "{made:?}");
    let result: Value = serde_json::from_slice(&made.stdout)?;
    let steps = result["report"]["training"]["steps"].as_u64();
    ensure!(steps > Some(0), "{result:#}");
    ensure!(
        result["files"].as_array().map(Vec::len) == Some(2),
        "{result:#}"
    );
    // A program finds what people read in the doubtful lines.
    ensure!(
        result["report"]["lacks"][0]["what"].is_string(),
        "{result:#}"
    );
    let log = std::fs::read_to_string(dir.path().join("o/log.txt"))?;
    for line in ["found: ", "doubtful: ", "o/play.html"] {
        ensure!(log.contains(line), "{line}: {log}");
    }

    moved(&dir.path().join(&capture), 0.9)?;
    let failed = yoto(
        dir.path(),
        &format!("avatar {} {options}", capture.display()),
    )?;
    let said = said(&failed);
    ensure!(
        !failed.status.success() && said.lines().count() == 1,
        "{said}"
    );
    ensure!(
        said.starts_with("error: ") && said.contains("sheet.png"),
        "{said}"
    );
    let result: Value = serde_json::from_slice(&failed.stdout)?;
    let error = result["error"].as_str().context("an error")?;
    ensure!(error.contains("--despite-check"), "{result:#}");
    Ok(())
}

#[test]
fn a_capture_whose_check_fails_is_not_trained() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join(example(dir.path())?);
    moved(&capture, 0.9)?;
    let line = format!("avatar {} --size 48 --seconds 3 --out o", capture.display());
    let made = yoto(dir.path(), &line)?;
    let said = said(&made);
    ensure!(!made.status.success(), "{said}");
    ensure!(said.contains("--despite-check"), "{said}");
    ensure!(!said.contains("training of"), "{said}");
    // The failed measures with their frames, and no others.
    ensure!(
        said.contains("  fail  ") && said.contains("see frames"),
        "{said}"
    );
    ensure!(!said.contains("  pass  "), "{said}");
    let log = std::fs::read_to_string(dir.path().join("o/attempt/log.txt"))?;
    ensure!(log.contains("  pass  ") && log.contains("error: "), "{log}");
    ensure!(dir.path().join("o/attempt/check/sheet.png").is_file());
    Ok(())
}

/// What makes a browser load the page again.
const REFRESH: &str = "location.reload()";

/// Waits until the page at `path` has all the `words`.
#[cfg(target_os = "linux")]
fn page_with(path: &Path, words: &[&str]) -> anyhow::Result<String> {
    let began = std::time::Instant::now();
    let mut page = String::new();
    while began.elapsed() < yoto_tests::process::PATIENCE {
        page = std::fs::read_to_string(path).unwrap_or_default();
        if words.iter().all(|word| page.contains(word)) {
            return Ok(page);
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    anyhow::bail!("{words:?} are not in {page}")
}

/// A folder with a browser that copies the file that it should open.
#[cfg(target_os = "linux")]
fn browser(folder: &Path) -> anyhow::Result<PathBuf> {
    use std::os::unix::fs::PermissionsExt;
    let programs = folder.join("programs");
    std::fs::create_dir(&programs)?;
    let program = programs.join("xdg-open");
    let opened = folder.join("opened.html");
    std::fs::write(
        &program,
        format!("#!/bin/sh\n/bin/cp \"$1\" {}\n", opened.display()),
    )?;
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755))?;
    Ok(programs)
}

#[cfg(target_os = "linux")]
#[test]
fn the_page_shows_the_training_and_an_interruption_ends_its_refresh() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = example(dir.path())?;
    let line = format!(
        "avatar {} --size 32 --seconds 600 --open --out o",
        capture.display()
    );
    let mut training = Command::new(YOTO)
        .args(line.split_whitespace())
        .current_dir(dir.path())
        .env("PATH", browser(dir.path())?)
        .stderr(std::process::Stdio::null())
        .spawn()?;
    let page = dir.path().join("o/index.html");
    let shown = page_with(
        &page,
        &[REFRESH, "<progress", "held-out", "pictures/progress/"],
    );
    // The process must not outlive a failed test.
    let interrupted = Command::new("kill")
        .args(["-INT", &training.id().to_string()])
        .status();
    let ended = training.wait()?;
    let shown = shown?;
    ensure!(interrupted?.success() && !ended.success());
    let picture = shown.split('"').find(|it| it.starts_with("pictures/"));
    let picture = picture.context("a picture")?;
    let picture = image::open(dir.path().join("o").join(picture))?;
    ensure!(picture.width() > 32, "a frame beside its render");
    let last = std::fs::read_to_string(&page)?;
    ensure!(
        !last.contains(REFRESH) && last.contains("interrupted"),
        "{last}"
    );
    let opened = std::fs::read_to_string(dir.path().join("opened.html"))?;
    ensure!(opened.contains(REFRESH), "opened at once: {opened}");
    Ok(())
}

#[test]
fn the_page_of_a_capture_that_is_refused_says_so() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join(example(dir.path())?);
    moved(&capture, 3.0)?;
    let line = format!(
        "avatar {} --size 32 --seconds 3 --despite-check --out o",
        capture.display()
    );
    let made = yoto(dir.path(), &line)?;
    ensure!(!made.status.success(), "{}", said(&made));
    let page = std::fs::read_to_string(dir.path().join("o/index.html"))?;
    ensure!(!page.contains(REFRESH), "{page}");
    ensure!(page.contains("There is no avatar: "), "{page}");
    ensure!(page.contains("joints in the mask"), "{page}");
    Ok(())
}

/// The output of SAM 3D Body for a clip, with its own joints; the result shows the clip's own motion.
#[test]
fn a_tool_s_own_skeleton_becomes_a_page() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("formats/pose_tools/captures");
    let line = format!(
        "avatar {} --poses {} --keep-skeleton --fps 25 --size 32 --seconds 2 --despite-check --verbose --out o",
        files.join("clip/frames").display(),
        files.join("sam_3d_body").display()
    );
    let made = yoto(dir.path(), &line)?;
    let said = said(&made);
    ensure!(made.status.success(), "{said}");
    ensure!(
        said.contains("note: ") && said.contains("  pass  "),
        "{said}"
    );
    let page = std::fs::read_to_string(dir.path().join("o/index.html"))?;
    ensure!(page.contains("In the clip's own motion."), "{page}");
    ensure!(
        page.contains("the skeleton is the tool's own: 22 joints"),
        "{page}"
    );
    let report: Value = serde_json::from_slice(&std::fs::read(dir.path().join("o/report.json"))?)?;
    ensure!(
        report["motion"].as_array().map(Vec::len) == Some(16),
        "{report:#}"
    );
    Ok(())
}

#[test]
fn a_video_alone_needs_the_pose_model() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let cast = SyntheticPerson::cast(1, 7);
    let (_, film) = cast.first().context("one person")?.capture(4, 64);
    yoto_tests::film::write_mp4(&film, 15, &dir.path().join("walk.mp4"))?;
    let made = yoto(dir.path(), "avatar walk.mp4")?;
    let said = said(&made);
    ensure!(!made.status.success(), "{said}");
    ensure!(said.contains("--pose-model"), "{said}");
    ensure!(said.contains("deploy/models/get.sh"), "{said}");
    Ok(())
}

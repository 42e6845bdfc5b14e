//! People agree, revoke and are erased, with a worker that writes checkpoints anew.

use anyhow::ensure;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::folders::{files, text};
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 48;

#[test]
fn who_is_erased_leaves_nothing_and_nobody_else_changes() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let data = dir.path().join("data");
    let service = Service::start(YOTO, &data, true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    for (person, name) in SyntheticPerson::cast(3, 7)
        .iter()
        .zip(["ada", "bob", "cleo-4f1d9a"])
    {
        let capture = dir.path().join(name);
        write_capture(person, 24, SIZE, &capture)?;
        let line = format!("subject add {name} --capture {}", text(&capture)?);
        yoto(&line, succeed)?;
    }
    let picture = |out: &str| -> anyhow::Result<Vec<u8>> {
        let out = dir.path().join(out);
        let line = "render duo --subject ada --orbit 3 --views 1 --size 48 --out";
        yoto(&format!("{line} {}", text(&out)?), succeed)?;
        Ok(std::fs::read(out.join("000000.png"))?)
    };
    yoto("model create duo --subjects ada,bob --tier draft", succeed)?;
    yoto("train duo --steps 30", succeed)?;
    yoto("model add-person duo cleo-4f1d9a --steps 20", succeed)?;
    let before = picture("before")?;

    yoto(
        "subject consent cleo-4f1d9a --for render --until 2999-12-31",
        succeed,
    )?;
    let shown = yoto("subject show cleo-4f1d9a", succeed)?;
    ensure!(shown.contains("render until 3000-01-01"), "{shown}");
    yoto("subject revoke-consent cleo-4f1d9a --for render", succeed)?;
    let cleo = dir.path().join("cleo.out");
    let line = format!(
        "render duo --subject cleo-4f1d9a --orbit 0 --views 1 --out {}",
        text(&cleo)?
    );
    let said = yoto(&line, fail)?;
    ensure!(
        said.contains("cleo-4f1d9a") && said.contains("render"),
        "{said}"
    );

    let said = yoto("subject erase cleo-4f1d9a", fail)?;
    ensure!(said.contains("--yes"), "{said}");
    let said = yoto("subject erase cleo-4f1d9a --yes", succeed)?;
    ensure!(
        said.contains("never saw them") && said.contains("DONE"),
        "{said}"
    );
    ensure!(
        before == picture("after")?,
        "somebody else renders differently"
    );
    for path in files(data.join("objects"))? {
        let bytes = std::fs::read(&path)?;
        let name = b"cleo-4f1d9a";
        let found = bytes.windows(name.len()).any(|it| it == name);
        ensure!(!found, "{} has their name", path.display());
    }
    let shown = yoto("subject erasure cleo-4f1d9a", succeed)?;
    ensure!(shown.contains("\"objects_left\": 0"), "{shown}");
    yoto("subject show cleo-4f1d9a", fail)?;

    // The shared part was trained on Bob.
    let said = yoto("subject erase bob --yes", succeed)?;
    ensure!(said.contains("what they learned stays"), "{said}");
    ensure!(before == picture("without-bob")?, "ada renders differently");
    yoto("train duo --steps 5", succeed)?;
    Ok(())
}

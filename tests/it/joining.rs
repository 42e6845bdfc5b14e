//! A person joins a trained model of the service, and the others do not change.

use anyhow::ensure;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::folders::text;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 48;

#[test]
fn who_joins_a_trained_model_is_trained_in_it_and_nobody_else_changes() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    for (person, name) in SyntheticPerson::cast(4, 7)
        .iter()
        .zip(["ada", "bob", "cleo", "dora"])
    {
        let capture = dir.path().join(name);
        write_capture(person, 24, SIZE, &capture)?;
        yoto(
            &format!("subject add {name} --capture {}", text(&capture)?),
            succeed,
        )?;
    }
    let picture = |subject: &str, out: &str| -> anyhow::Result<Vec<u8>> {
        let out = dir.path().join(out);
        let line = format!("render duo --subject {subject} --orbit 3 --views 1 --size 48 --out");
        yoto(&format!("{line} {}", text(&out)?), succeed)?;
        Ok(std::fs::read(out.join("000000.png"))?)
    };

    yoto("model create duo --subjects ada,bob --tier draft", succeed)?;
    let said = yoto("model add-person duo cleo --steps 20", fail)?;
    ensure!(
        said.contains("untrained") && said.contains("yoto train duo"),
        "{said}"
    );
    let said = yoto("train duo --only ada --steps 20", fail)?;
    ensure!(said.contains("untrained"), "{said}");
    yoto("train duo --steps 30", succeed)?;
    let said = yoto("train duo --only cleo --steps 20", fail)?;
    ensure!(said.contains("cleo is not in duo"), "{said}");
    let before = [picture("ada", "ada-before")?, picture("bob", "bob-before")?];

    let said = yoto("model add-person duo cleo --steps 40", succeed)?;
    ensure!(said.contains("dB") && said.contains("40 steps"), "{said}");
    let after = [picture("ada", "ada-after")?, picture("bob", "bob-after")?];
    ensure!(before == after, "somebody else renders differently");
    ensure!(!before.contains(&picture("cleo", "cleo")?));
    let said = yoto("model add-person duo cleo", fail)?;
    ensure!(said.contains("train duo --only cleo"), "{said}");

    // A training of all people changes all of them.
    yoto("train duo --only cleo --steps 10", succeed)?;
    ensure!(before[0] == picture("ada", "ada-still")?);
    yoto("train duo --steps 30", succeed)?;
    let new = picture("ada", "ada-new")?;
    ensure!(before[0] != new);

    // One person on another's bones.
    let own = "render duo --subject ada --orbit 3 --views 1 --size 48";
    let other = dir.path().join("ada-on-bob");
    yoto(
        &format!("{own} --bones bob --out {}", text(&other)?),
        succeed,
    )?;
    ensure!(std::fs::read(other.join("000000.png"))? != new);
    let nobody = dir.path().join("ada-on-dora");
    let said = yoto(
        &format!("{own} --bones dora --out {}", text(&nobody)?),
        fail,
    )?;
    ensure!(said.contains("dora is not in duo"), "{said}");

    // A person may also join with a training of all people.
    let said = yoto("model add-person duo dora --steps 10 --refine 1", succeed)?;
    ensure!(said.matches("dB").count() > 1, "{said}");
    ensure!(new != picture("ada", "ada-refined")?);
    Ok(())
}

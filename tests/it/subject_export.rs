//! A person is given all that is held of them, and nothing of anybody else.

use anyhow::{Context, ensure};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::folders::{files, text};
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const SIZE: u32 = 48;

/// The only folder in `root`.
fn only(root: &Path) -> anyhow::Result<PathBuf> {
    let entries: Vec<_> = std::fs::read_dir(root)?.collect::<Result<_, _>>()?;
    ensure!(
        entries.len() == 1,
        "{} in {}",
        entries.len(),
        root.display()
    );
    Ok(entries[0].path())
}

/// Names of the tensors in a file.
fn tensors(path: &Path) -> anyhow::Result<BTreeSet<String>> {
    let bytes = std::fs::read(path)?;
    let (length, rest) = bytes.split_first_chunk::<8>().context("a length")?;
    let length = usize::try_from(u64::from_le_bytes(*length))?;
    let header: Value = serde_json::from_slice(rest.get(..length).context("a header")?)?;
    let names = header.as_object().context("an object")?.keys();
    Ok(names.filter(|it| *it != "__metadata__").cloned().collect())
}

#[test]
fn a_person_gets_what_is_theirs_and_nothing_of_others() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    let place = |name: &str| dir.path().join(name);
    let names = ["ada-17c2", "bob-55ae"];
    for (person, name) in SyntheticPerson::cast(2, 7).iter().zip(names) {
        write_capture(person, 24, SIZE, &place(name))?;
        let line = format!("subject add {name} --capture {}", text(&place(name))?);
        yoto(&line, succeed)?;
    }
    let [ada, bob] = names;
    yoto(
        &format!("subject consent {ada} --for train,render"),
        succeed,
    )?;
    yoto(
        &format!("model create duo --subjects {ada},{bob} --tier draft"),
        succeed,
    )?;
    yoto("train duo --steps 30", succeed)?;
    yoto(
        &format!("model create alike --subjects {ada},{bob} --tier draft --variant no-identity"),
        succeed,
    )?;
    for (out, more) in [("alone", ""), ("bones", &*format!(" --bones {bob}"))] {
        let line = format!("render duo --subject {ada} --orbit 3 --views 1 --size 48{more} --out");
        yoto(&format!("{line} {}", text(&place(out))?), succeed)?;
    }
    yoto("evaluate duo --size 48", succeed)?;

    let export = |name: &str, out: &str, run| {
        let line = format!("subject export {name} --out");
        yoto(&format!("{line} {}", text(&place(out))?), run)
    };
    let said = export(ada, "theirs", succeed)?;
    ensure!(said.contains("2 things left out"), "{said}");
    let theirs = place("theirs");
    let about: Value = serde_json::from_slice(&std::fs::read(theirs.join("person.json"))?)?;
    ensure!(about["subject"]["display_name"] == ada, "{about:#}");
    let consents = about["consents"].as_array().context("consents")?;
    ensure!(!consents.is_empty(), "{about:#}");
    ensure!(about["models"][0]["slot"] == 0, "{about:#}");
    for (at, why) in ["none of their own", "somebody else"].iter().enumerate() {
        let left_out = about["left_out"][at].as_str().context("a reason")?;
        ensure!(left_out.contains(why), "{left_out}");
    }

    // The capture is the one that was added, and can be added again.
    let capture = only(&theirs.join("captures"))?;
    for file in ["frames/000007.png", "masks/000007.png"] {
        let [was, is] = [&place(ada), &capture].map(|folder| std::fs::read(folder.join(file)));
        ensure!(was? == is?, "{file} is another");
    }
    ensure!(capture.join("thumbnail.png").exists() && capture.join("check.json").exists());
    let line = format!("subject add again --capture {}", text(&capture)?);
    yoto(&line, succeed)?;

    let jobs = files(theirs.join("jobs"))?;
    let picture = jobs.iter().find(|path| path.ends_with("000000.png"));
    let picture = std::fs::read(picture.context("the render of her alone")?)?;
    ensure!(picture == std::fs::read(place("alone").join("000000.png"))?);
    let scores = jobs.iter().find(|path| path.ends_with("scores.json"));
    let scores: Value = serde_json::from_slice(&std::fs::read(scores.context("her scores")?)?)?;
    ensure!(scores.as_array().map(Vec::len) == Some(1), "{scores:#}");

    // What is hers of the model is not his, and neither has what both share.
    export(bob, "his", succeed)?;
    let own = |out: &str| -> anyhow::Result<BTreeSet<String>> {
        let weights = files(place(out).join("models"))?;
        let mut weights = weights
            .iter()
            .filter(|it| it.ends_with("person.safetensors"));
        tensors(weights.next().context("parameters")?)
    };
    let (hers, his) = (own("theirs")?, own("his")?);
    ensure!(!hers.is_empty() && hers.len() == his.len());
    ensure!(hers.is_disjoint(&his), "{:?}", hers.intersection(&his));
    let subject = about["subject"]["name"].as_str().context("a name")?;
    for (out, others) in [("theirs", bob), ("his", ada), ("his", subject)] {
        for path in files(place(out))? {
            let bytes = std::fs::read(&path)?;
            let found = bytes
                .windows(others.len())
                .any(|it| it == others.as_bytes());
            ensure!(!found, "{} names {others}", path.display());
        }
    }

    let said = export(ada, "theirs", fail)?;
    ensure!(said.contains("is not empty"), "{said}");
    let said = export("nobody", "none", fail)?;
    ensure!(said.contains("nobody"), "{said}");
    ensure!(!place("none").exists());
    yoto(&format!("subject erase {ada} --yes"), succeed)?;
    export(ada, "gone", fail)?;
    Ok(())
}

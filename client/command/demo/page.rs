//! The page of a demo, from which everything else is reached.

use super::report::DemoReport;
use anyhow::Context;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use yoto_player::escaped;

/// Template of the page, with fields in braces.
const PAGE: &str = include_str!("page.html");

/// Path of the page in the folder `out`.
pub(super) fn path(out: &Path) -> PathBuf {
    out.join("index.html")
}

/// Writes the page about the people with these `names`.
pub(super) fn write(out: &Path, names: &[&str], report: &DemoReport) -> anyhow::Result<()> {
    let path = path(out);
    std::fs::write(&path, page(names, report))
        .with_context(|| format!("writing {}", path.display()))
}

fn page(names: &[&str], report: &DemoReport) -> String {
    let people = names.iter().fold(String::new(), |mut text, name| {
        let name = escaped(name);
        let _ = writeln!(
            text,
            "<figure><a href=\"{name}.html\"><img src=\"orbit-{name}-animation.png\" \
             alt=\"{name} from all around\"></a><figcaption><a href=\"{name}.html\">{name}</a>\
             </figcaption></figure>"
        );
        text
    });
    let shared = match names {
        [first, second, ..] => format!(
            "<h2>One motion on another body</h2>\n<figure><img src=\"motion-transfer.png\" \
             alt=\"{second} in motion\"><figcaption>{second} in the motion of {first}.</figcaption>\
             </figure>\n<figure><img src=\"between.png\" alt=\"Ten people between two\"><figcaption>\
             From {first} to {second} in ten steps.</figcaption></figure>\n",
            first = escaped(first),
            second = escaped(second),
        ),
        _ => String::new(),
    };
    PAGE.replace("{count}", &names.len().to_string())
        .replace("{seconds}", &format!("{:.0}", report.train_seconds))
        .replace("{device}", &escaped(&report.device))
        .replace("{people}", &people)
        .replace("{shared}", &shared)
        .replace("{table}", &escaped(&report.table()))
}

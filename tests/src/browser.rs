//! A browser without a window, where the machine has one.

use crate::process::PATIENCE;
use anyhow::{Context, bail, ensure};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Names of the programs, in order of preference.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser of this machine.
pub struct Browser(&'static str);

impl Browser {
    /// The first one that runs; `None` without any, unless `YOTO_TEST_BROWSER` is `required`.
    ///
    /// # Errors
    /// When there is none and it is required.
    pub fn find() -> anyhow::Result<Option<Self>> {
        let runs = |program: &&str| {
            let version = Command::new(program)
                .arg("--version")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status();
            version.is_ok_and(|status| status.success())
        };
        if let Some(program) = PROGRAMS.into_iter().find(runs) {
            return Ok(Some(Self(program)));
        }
        if std::env::var("YOTO_TEST_BROWSER").is_ok_and(|value| value == "required") {
            bail!("YOTO_TEST_BROWSER is required, but none of {PROGRAMS:?} runs here");
        }
        Ok(None)
    }

    /// The JSON that the scripts of a `page` leave, as base64, in `document.body.dataset.found`.
    ///
    /// # Errors
    /// When the browser fails, or does not end, or nothing of the kind is there.
    pub fn found<T: DeserializeOwned>(&self, page: &str) -> anyhow::Result<T> {
        let dir = tempfile::tempdir()?;
        let path = dir.path().join("page.html");
        std::fs::write(&path, page)?;
        let document = self.document(&path)?;
        let found = document.split(r#"data-found=""#).nth(1);
        let found = found.and_then(|rest| rest.split('"').next());
        let found = STANDARD.decode(found.context("the scripts of the page left nothing")?)?;
        Ok(serde_json::from_slice(&found)?)
    }

    /// The document of the page at `path` after its scripts, on a software renderer.
    fn document(&self, path: &Path) -> anyhow::Result<String> {
        let profile = tempfile::tempdir()?;
        let mut browser = Command::new(self.0)
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-dev-shm-usage",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--dump-dom",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg(format!("file://{}", path.display()))
            .stdin(Stdio::null())
            .stdout(Stdio::from(File::create(profile.path().join("document"))?))
            .stderr(Stdio::from(File::create(profile.path().join("said"))?))
            .spawn()
            .with_context(|| format!("running {}", self.0))?;
        let began = Instant::now();
        let status = loop {
            if let Some(status) = browser.try_wait()? {
                break status;
            }
            if began.elapsed() > PATIENCE {
                browser.kill()?;
                break browser.wait()?;
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        let read = |name: &str| std::fs::read_to_string(profile.path().join(name));
        ensure!(status.success(), "{status}: {}", read("said")?);
        Ok(read("document")?)
    }
}

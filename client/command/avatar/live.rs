//! Keeps the page up to date while the person is trained: state, progress, and the picture of each checkpoint. The browser
//! reloads it until the final page replaces it, or the page says why the training failed. No server is needed: the page loads
//! nothing but the files beside it.

use super::live_page::html;
use super::page::{check, put};
use super::report::AvatarReport;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use yoto_proto::v1::Job;
use yoto_terminal::progress::describe;

/// Shortest time between two versions of the page, and time after which a browser reloads it.
pub(super) const OFTEN: Duration = Duration::from_secs(2);
/// Longest time between two versions of the page: its age tells a browser whether the program still runs.
const SELDOM: Duration = Duration::from_secs(10);

/// The picture of a checkpoint, relative to the page.
#[derive(Clone, Debug)]
pub(super) struct CheckpointPicture {
    pub step: u64,
    /// PSNR on held-out frames, dB.
    pub psnr: Option<f64>,
    pub path: String,
}

/// The state of the work, as the page shows it.
#[derive(Clone, Debug, Default)]
pub(super) struct WorkState {
    /// What is being done.
    pub doing: String,
    /// Share of the training that is done, 0 to 1; absent outside of it.
    pub fraction: Option<f64>,
    /// Held-out PSNR of the latest measurement, dB.
    pub psnr: Option<f64>,
    /// The newest last.
    pub pictures: Vec<CheckpointPicture>,
    /// Why the work has ended without the final page.
    pub stopped: Option<String>,
}

/// The page of a training under way; it is written until [`end`](Self::end) or [`stop`](Self::stop).
#[derive(Debug)]
pub(super) struct Live {
    state: watch::Sender<WorkState>,
    writing: JoinHandle<()>,
    page: Page,
}

/// How often the page is written.
#[derive(Clone, Copy, Debug)]
struct Rhythm {
    /// Shortest time between two versions.
    often: Duration,
    /// Longest one.
    seldom: Duration,
}

/// What stays the same on all versions of the page.
#[derive(Clone, Debug)]
struct Page {
    path: PathBuf,
    name: String,
    check: String,
}

impl Live {
    /// Writes the first version to `path`, about the capture of `report`, and keeps it up to date.
    ///
    /// # Errors
    /// When it can't be written.
    pub(super) fn start(path: &Path, report: &AvatarReport) -> anyhow::Result<Self> {
        let rhythm = Rhythm {
            often: OFTEN,
            seldom: SELDOM,
        };
        Self::start_with(path, report, rhythm)
    }

    fn start_with(path: &Path, report: &AvatarReport, rhythm: Rhythm) -> anyhow::Result<Self> {
        let page = Page {
            path: path.to_owned(),
            name: report.name.clone(),
            check: check(report),
        };
        let state = WorkState {
            doing: "reading the capture".into(),
            ..WorkState::default()
        };
        page.write(&state)?;
        let (state, states) = watch::channel(state);
        let writing = tokio::spawn(write_on(page.clone(), states, rhythm));
        Ok(Self {
            state,
            writing,
            page,
        })
    }

    /// Says what is being done after the training.
    pub(super) fn doing(&self, what: &str) {
        self.state.send_modify(|state| {
            state.doing = what.to_owned();
            state.fraction = None;
        });
    }

    /// Shows the progress of the training.
    pub(super) fn job(&self, job: &Job) {
        if let Some(progress) = &job.progress {
            self.state.send_modify(|state| {
                state.doing = describe(progress);
                state.fraction = Some(progress.fraction);
                state.psnr = progress.psnr;
            });
        }
    }

    /// What adds a checkpoint's picture, with its step and path, to the page.
    pub(super) fn pictures(&self) -> impl FnMut(u64, &Path) + Send + 'static {
        let state = self.state.clone();
        let folder = self.page.path.parent().map(Path::to_owned);
        move |step, path| {
            let path = folder.as_ref().and_then(|it| path.strip_prefix(it).ok());
            if let Some(path) = path {
                let path = path.display().to_string().replace('\\', "/");
                state.send_modify(|state| {
                    let psnr = state.psnr;
                    state.pictures.push(CheckpointPicture { step, psnr, path });
                });
            }
        }
    }

    /// Ends the updates, so that the final page can be written.
    pub(super) async fn end(&mut self) {
        if !self.writing.is_finished() {
            self.writing.abort();
            // Its end by `abort` is no failure.
            let _ = (&mut self.writing).await;
        }
    }

    /// Ends the updates with a page that says why there is no avatar.
    ///
    /// # Errors
    /// When it can't be written.
    pub(super) async fn stop(mut self, why: &str) -> anyhow::Result<()> {
        let page = self.page.clone();
        let mut state = self.state.borrow().clone();
        state.stopped = Some(why.to_owned());
        self.end().await;
        page.write(&state)
    }
}

/// Writes the page at each change, but not too often, and from time to time without one.
async fn write_on(page: Page, mut states: watch::Receiver<WorkState>, rhythm: Rhythm) {
    loop {
        let ended = tokio::time::timeout(rhythm.seldom, states.changed()).await;
        if matches!(ended, Ok(Err(_))) {
            return;
        }
        let state = states.borrow_and_update().clone();
        if let Err(error) = page.write(&state) {
            detail!("note: {error:#}");
        }
        tokio::time::sleep(rhythm.often).await;
    }
}

impl Page {
    fn write(&self, state: &WorkState) -> anyhow::Result<()> {
        put(&self.path, &html(&self.name, &self.check, state))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::report::Seconds;

    fn report() -> AvatarReport {
        AvatarReport {
            name: "<b>Ada</b>".into(),
            frames: 3,
            image_size: [64, 96],
            fps: 30.0,
            notes: Vec::new(),
            check: Vec::new(),
            causes: Vec::new(),
            lacks: Vec::new(),
            orbit_frame: 1,
            size: 64,
            training: None,
            orbit: Vec::new(),
            motion: Vec::new(),
            seconds: Seconds::default(),
        }
    }

    fn read(path: &Path) -> String {
        std::fs::read_to_string(path).expect("a page")
    }

    #[tokio::test]
    async fn a_page_refreshes_until_it_is_stopped_and_says_why() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("index.html");
        let live = Live::start(&path, &report()).expect("a page");
        let first = read(&path);
        assert!(first.contains("location.reload()"), "{first}");
        // A page whose writer was killed must not reload forever.
        assert!(first.contains("if (Date.now() - "), "{first}");
        assert!(first.contains("&lt;b&gt;Ada&lt;/b&gt;"), "{first}");
        let mut add = live.pictures();
        add(12, &folder.path().join("pictures/progress/000012.png"));
        add(40, &folder.path().join("pictures/progress/000040.png"));
        live.stop("jobs/1 failed: <disk full>")
            .await
            .expect("a page");
        let last = read(&path);
        assert!(!last.contains("reload"), "{last}");
        assert!(last.contains("jobs/1 failed: &lt;disk full&gt;"), "{last}");
        let place = |step: &str| last.find(step).expect("a picture");
        let newest = place("src=\"pictures/progress/000040.png\"");
        assert!(newest < place("class=\"strip\"") && newest < place("000012.png"));
    }

    /// Waits until the page at `path` has the `words`.
    async fn shows(path: &Path, words: &str) -> bool {
        for _ in 0..1000 {
            if read(path).contains(words) {
                return true;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        false
    }

    #[tokio::test]
    async fn changes_reach_the_page_and_nothing_is_written_after_the_end() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("index.html");
        let rhythm = Rhythm {
            often: Duration::from_millis(1),
            seldom: Duration::from_millis(5),
        };
        let mut live = Live::start_with(&path, &report(), rhythm).expect("a page");
        live.doing("rendering a <motion>");
        assert!(shows(&path, "rendering a &lt;motion&gt;").await);
        std::fs::write(&path, "old").expect("written");
        assert!(shows(&path, "rendering").await, "it is written anew");
        live.end().await;
        std::fs::write(&path, "final").expect("written");
        tokio::time::sleep(20 * rhythm.seldom).await;
        assert_eq!(read(&path), "final");
    }
}

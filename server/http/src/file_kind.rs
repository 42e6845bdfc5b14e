//! How a browser treats a file, and what the file may do there.
//!
//! A worker has written it, so it may never act as one of the service's pages: a browser shows only pictures in place, and gives
//! an exported page an origin of its own, in which it can neither call the service nor load anything.

use yoto_proto::v1::{Job, ObjectRef, job_result};

/// What a player may do in frames of these sites. It has its script and its data in itself. Without `allow-same-origin` its
/// origin is its own.
macro_rules! player {
    ($ancestors:literal) => {
        concat!(
            "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; \
             style-src 'unsafe-inline'; img-src data: blob:; connect-src data: blob:; worker-src blob:; \
             frame-ancestors ",
            $ancestors
        )
    };
}
/// The policy of a player in our own pages.
pub const PLAYER: &str = player!("'self'");
/// The policy of a player that is a page for itself.
pub const LONE_PLAYER: &str = player!("'none'");
/// The policy of a player that any site may show.
pub const EMBEDDED_PLAYER: &str = player!("*");
/// How a browser treats a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Shows it, also in a page.
    Picture(&'static str),
    /// Runs it in an origin of its own.
    Player,
    /// Keeps it as a file.
    Other,
}

impl FileKind {
    /// By the name of the file.
    pub fn of(file: &str) -> Self {
        let extension = file.rsplit_once('.').map_or("", |(_, it)| it);
        match extension {
            "png" => Self::Picture("image/png"),
            "jpg" | "jpeg" => Self::Picture("image/jpeg"),
            "webp" => Self::Picture("image/webp"),
            "gif" => Self::Picture("image/gif"),
            "html" => Self::Player,
            _ => Self::Other,
        }
    }
}

/// How the content type of a page begins.
const PAGE: &str = "text/html";

/// The page that an export has made.
pub fn page_of_export(job: &Job) -> Option<&ObjectRef> {
    let result = job.result.as_ref().and_then(|it| it.kind.as_ref())?;
    let job_result::Kind::Export(export) = result else {
        return None;
    };
    let page = export
        .files
        .iter()
        .find(|it| it.content_type.starts_with(PAGE))?;
    page.object.as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_known_pictures_are_shown_in_place() {
        assert_eq!(FileKind::of("000001.png"), FileKind::Picture("image/png"));
        assert_eq!(FileKind::of("ada.html"), FileKind::Player);
        for other in ["a.svg", "a.xhtml", "a.js", "png", "a.PNG.exe", ""] {
            assert_eq!(FileKind::of(other), FileKind::Other, "{other}");
        }
    }
}

//! Reads uploaded captures: files in, a training shard and the check's report out.
//!
//! Uploads are decoded in a child process: this program, started again, with limits on memory and
//! time, so that a file that makes a decoder crash, hang or use too much memory ends only that
//! process ([`ingest`], [`become_ingest_child_if_asked`]). The kernel confines it to its folder, without a network
//! ([`Confinement`]). So is the picture behind a scene ([`read_backdrop`]), which
//! comes with an order. The user's own captures are read in this process ([`LocalCapture`]), by the same code.
//!
//! Faults of a capture are reported with file, frame and field. An exceeded limit is a fault of the
//! capture, and is named; a fault of this machine never rejects a capture.

mod backdrop;
mod capture;
mod child;
mod confinement;
mod edges;
mod failure;
mod film;
mod local;
mod order;
mod prepare;
mod reader;
mod settings;
mod supervise;
mod unpack;
mod upload;
mod video_end;

pub use backdrop::read_backdrop;
pub use child::become_ingest_child_if_asked;
pub use confinement::{Confinement, Extent};
pub use failure::{IngestError, ReadFailure};
pub use film::{Film, FilmCapture, FilmReader, Tell};
pub use local::LocalCapture;
pub use order::{Progress, Stage};
pub use settings::IngestSettings;
pub use upload::{Ingested, ingest};
pub use video_end::end_with_videos;
pub use yoto_media::archive::Files;

/// Most violations reported per capture, since an export error repeats in every frame.
const MAX_VIOLATIONS: usize = 20;

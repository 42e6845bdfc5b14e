//! Reading captures as users upload them: files in, a training shard and the check's report out.
//!
//! What somebody else uploaded is decoded in a child process: this program, started again, with
//! limits on memory and time, so that a file which makes a decoder crash, hang or swell ends that
//! process only ([`ingest`], [`become_ingest_child_if_asked`]). A capture of one's own is read in
//! this process ([`LocalCapture`]), by the same code.
//!
//! Everything wrong with a capture is told with file, frame and field. A limit that is exceeded
//! is the capture's fault, and is named; a fault of this machine rejects nothing.

mod capture;
mod child;
mod failure;
mod local;
mod order;
mod prepare;
mod reader;
mod settings;
mod supervise;
mod unpack;
mod upload;

pub use child::become_ingest_child_if_asked;
pub use failure::{IngestError, ReadFailure};
pub use local::LocalCapture;
pub use order::Place;
pub use settings::IngestSettings;
pub use upload::{Ingested, ingest};
pub use yoto_media::archive::Files;

/// Most violations reported of one capture; a wrong export repeats in every frame.
const MAX_VIOLATIONS: usize = 20;

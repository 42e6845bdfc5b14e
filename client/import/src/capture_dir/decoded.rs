//! A capture on this disk, decoded in this process as an ingest job decodes an upload: from pictures,
//! videos or archives.

use super::{CaptureDir, CaptureOptions, FileSource};
use anyhow::Context;
use std::collections::BTreeMap;
use std::path::Path;
use yoto_capture::{Shard, ShardBuilder};
use yoto_ingest::LocalCapture;
use yoto_proto::media_plan::MediaPlan;

/// A capture whose frames can be decoded.
pub struct DecodedCapture {
    /// Its last folder or file name.
    pub name: String,
    /// The plan of its reading.
    pub plan: MediaPlan,
    /// Its frames.
    pub capture: LocalCapture,
}

impl DecodedCapture {
    /// Opens the capture at `path`, a folder or an archive, read as `options` say; videos of other
    /// kinds by the program `ffmpeg`, which is searched for when it has no name.
    ///
    /// # Errors
    /// A capture that can't be read; each fault names file, frame and field.
    pub fn open(
        path: &Path,
        options: &CaptureOptions,
        ffmpeg: Option<&Path>,
    ) -> anyhow::Result<Self> {
        let found = CaptureDir::open_with(path, options)?;
        let full = path.canonicalize();
        let full = full.with_context(|| format!("finding {}", path.display()))?;
        let name = full.file_name().unwrap_or(path.as_os_str());
        let name = name.to_string_lossy().into_owned();
        // The plan and the track are in memory, but the reader needs them on disk.
        let written = tempfile::tempdir().context("making a temporary folder")?;
        let mut files = BTreeMap::new();
        for (number, file) in found.files.into_iter().enumerate() {
            let disk = match file.source {
                FileSource::Disk(path) => path,
                FileSource::Memory(bytes) => {
                    let path = written.path().join(number.to_string());
                    std::fs::write(&path, bytes)
                        .with_context(|| format!("writing {}", path.display()))?;
                    path
                }
            };
            files.insert(file.path, disk);
        }
        Ok(Self {
            name,
            plan: found.plan,
            capture: LocalCapture::open(&files, ffmpeg)?,
        })
    }

    /// All frames; `decoded` receives the number of frames so far.
    ///
    /// # Errors
    /// The fault of the first frame that can't be read.
    pub fn shard(&self, mut decoded: impl FnMut(usize)) -> anyhow::Result<Shard> {
        let track = self.capture.track();
        let positions: Vec<usize> = (0..track.frames.len()).collect();
        let mut builder = ShardBuilder::new(track.clone());
        let (mut done, mut packed) = (0, Ok(()));
        self.capture.frames(&positions, |_, frame| {
            if packed.is_ok() {
                packed = builder.push(&frame);
            }
            done += 1;
            decoded(done);
        })?;
        packed?;
        Ok(builder.finish()?)
    }
}

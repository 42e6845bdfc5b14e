//! The files of an upload, from its parts to scratch files: decoders and `ffmpeg` need files in which they can seek.

use super::super::{JobContext, JobFailure};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use yoto_ingest::Files;
use yoto_objects::{Extent, ObjectsError, Part, Piece};
use yoto_proto::hex;
use yoto_proto::worker::v1::{InputFile, Inputs};

/// A file that is put together from its pieces.
struct Growing<'a> {
    input: &'a InputFile,
    path: PathBuf,
    bytes: u64,
    hash: Sha256,
}

impl Growing<'_> {
    /// Appends `extent`, which follows what is there.
    fn append(&mut self, extent: &Extent<usize>) -> std::io::Result<()> {
        if extent.offset != self.bytes {
            return Err(std::io::Error::other(format!(
                "byte {} of {} comes before byte {}",
                extent.offset, self.input.path, self.bytes
            )));
        }
        let mut file = OpenOptions::new().append(true).open(&self.path)?;
        file.write_all(&extent.bytes)?;
        self.hash.update(&extent.bytes);
        self.bytes += extent.bytes.len() as u64;
        Ok(())
    }

    /// Compares the whole file with what was uploaded.
    fn check(self) -> Result<(), JobFailure> {
        let InputFile {
            path,
            bytes,
            sha256,
            ..
        } = self.input;
        let found = hex(&self.hash.finalize());
        if self.bytes == *bytes && found == *sha256 {
            return Ok(());
        }
        Err(JobFailure::Failed {
            code: "OBJECTS",
            message: format!(
                "{path}: the store has {} bytes of it with the SHA-256 {found}, not {bytes} with {sha256}",
                self.bytes
            ),
        })
    }
}

/// Writes all files of the upload into `folder`. Each part is read once, in windows that fit into memory.
///
/// # Errors
/// When the store has lost or altered bytes, with the names of the files; faults of the store and of this machine.
pub(super) fn fetch(
    context: &JobContext,
    inputs: &Inputs,
    folder: &Path,
) -> Result<Files, JobFailure> {
    let mut files = Files::new();
    let mut growing = Vec::with_capacity(inputs.files.len());
    let machine = |error| JobFailure::machine("writing the uploaded files", &error);
    let mut parts: Vec<Part<usize>> = inputs.parts.iter().map(without_pieces).collect();
    let steps = parts.len() + inputs.files.iter().filter(|it| it.object.is_some()).count();
    let mut done = 0;
    for (number, input) in inputs.files.iter().enumerate() {
        // Under a number: uploaded names are never used as paths on this disk.
        let path = folder.join(format!("upload-{number:06}"));
        files.insert(input.path.clone(), path.clone());
        if let Some(object) = &input.object {
            context.check()?;
            context.report_pieces("fetching", done, steps);
            context
                .get_to_file(object, &path)
                .map_err(|failure| match failure {
                    JobFailure::Failed { code, message } => JobFailure::Failed {
                        code,
                        message: format!("{}: {message}", input.path),
                    },
                    other => other,
                })?;
            done += 1;
            continue;
        }
        File::create_new(&path).map_err(machine)?;
        let mut offset = 0;
        let index = growing.len();
        for piece in &input.pieces {
            let part = parts.get_mut(piece.part as usize).ok_or_else(|| {
                let message = format!("{}: the order has no part {}", input.path, piece.part);
                JobFailure::Failed {
                    code: "INTERNAL",
                    message,
                }
            })?;
            part.pieces.push(Piece {
                file: index,
                offset,
                start: piece.start,
                bytes: piece.bytes,
            });
            offset += piece.bytes;
        }
        growing.push(Growing {
            input,
            path,
            bytes: 0,
            hash: Sha256::new(),
        });
    }
    for mut part in parts {
        context.check()?;
        context.report_pieces("fetching", done, steps);
        part.pieces.sort_by_key(|piece| piece.start);
        let names = names(&part, &growing);
        let take = |extent: Extent<usize>| match growing.get_mut(extent.file) {
            Some(file) => file.append(&extent),
            None => Ok(()),
        };
        let read = context.get_part(part, take)?;
        read.map_err(|error| told(&names, error))?
            .map_err(machine)?;
        done += 1;
    }
    growing.into_iter().try_for_each(Growing::check)?;
    Ok(files)
}

fn without_pieces(object: &yoto_proto::v1::ObjectRef) -> Part<usize> {
    Part {
        object: object.clone(),
        pieces: Vec::new(),
    }
}

/// The files with pieces in `part`, for people.
fn names(part: &Part<usize>, files: &[Growing<'_>]) -> String {
    let files = part.pieces.iter().filter_map(|it| files.get(it.file));
    let names: BTreeSet<&str> = files.map(|it| it.input.path.as_str()).collect();
    let first = names.first().copied().unwrap_or_default();
    match names.len() {
        0 | 1 => first.to_owned(),
        count => format!("{first} and {} more", count - 1),
    }
}

/// The failure when a part with bytes of the files `names` can't be read.
fn told(names: &str, error: ObjectsError) -> JobFailure {
    match error.is_torn() {
        true => JobFailure::failed("OBJECTS", names, &error),
        false => JobFailure::try_later("OBJECTS", names, &error),
    }
}

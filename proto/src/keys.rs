//! Keys of objects in the store.
//!
//! Everything a worker writes has its job and fencing token in the key, so that a worker
//! that lost its lease can't overwrite what its successor wrote. The database row that
//! names a key is the commit point; an object without a row is garbage, which is collected by the
//! folder ([`FolderOwner`]).

/// The folder of an upload.
pub fn upload_folder(capture_id: &str) -> String {
    format!("uploads/{capture_id}")
}

/// The folder of an upload's parts.
pub fn upload_parts(capture_id: &str) -> String {
    format!("uploads/{capture_id}/parts")
}

/// The bytes of an upload that its `writer` commits at once, as commit `number`. Numbers of writers only grow, and only
/// the newest one commits.
pub fn upload_part(capture_id: &str, writer: u64, number: u64) -> String {
    format!("uploads/{capture_id}/parts/{writer}-{number}")
}

/// Writer and number in the key of a part; `None` for other keys.
pub fn writer_of_part(key: &str) -> Option<(u64, u64)> {
    let mut segments = key.split('/');
    let (root, _, folder) = (segments.next()?, segments.next()?, segments.next()?);
    let (writer, number) = segments.next()?.split_once('-')?;
    if root != "uploads" || folder != "parts" || segments.next().is_some() {
        return None;
    }
    Some((writer.parse().ok()?, number.parse().ok()?))
}

/// The training shard of a capture.
pub fn shard(capture_id: &str, job_id: &str, token: u64) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/shard.bin")
}

/// File of the report of a capture's check.
pub const CHECK: &str = "check.json";
/// File of the small picture of a capture.
pub const THUMBNAIL: &str = "thumbnail.png";

/// File of a capture's frames, as a training reads them: its shard.
pub const FRAMES: &str = "frames.shard";

/// What the ingest job of a capture makes for people: [`CHECK`] or [`THUMBNAIL`].
pub fn of_capture(capture_id: &str, job_id: &str, token: u64, file: &str) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/{file}")
}

/// The folder of one checkpoint.
pub fn checkpoint(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!("models/{model_id}/{job_id}-{token}/{step:09}")
}

/// The trade-off of a checkpoint, measured by an evaluate job.
pub fn tradeoff(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!(
        "{}/tradeoff.json",
        checkpoint(model_id, job_id, token, step)
    )
}

/// A file of a render or export job.
pub fn render(job_id: &str, token: u64, file: &str) -> String {
    format!("renders/{job_id}/{token}/{file}")
}

/// File name of the picture with this `index` in a render, from 0.
pub fn picture(index: u32) -> String {
    format!("{index:06}.png")
}

/// Folders at the root of a store, each with the depth below it of the folders that are kept or deleted as a
/// whole.
pub const ROOTS: &[(&str, usize)] = &[
    ("uploads", 1),
    ("captures", 2),
    ("models", 3),
    ("renders", 2),
];

/// The folder with the object `key` that is kept or deleted as a whole; `None` for an object that is in no such folder.
pub fn collected_folder(key: &str) -> Option<&str> {
    let root = key.split('/').next()?;
    let (_, depth) = ROOTS.iter().find(|(known, _)| *known == root)?;
    let (end, _) = key.match_indices('/').nth(*depth)?;
    Some(&key[..end])
}

/// The owner of a folder that is kept or deleted as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FolderOwner<'a> {
    /// The files of an upload.
    Upload {
        /// Its capture's id.
        capture: &'a str,
    },
    /// The results of an ingest job of a capture.
    Shard {
        /// The capture's id.
        capture: &'a str,
        /// The job.
        by: Lease<'a>,
    },
    /// A checkpoint by a train job, or its trade-off by an evaluate job.
    Checkpoint {
        /// The model's id.
        model: &'a str,
        /// The job.
        by: Lease<'a>,
    },
    /// The files of a render or export job.
    Render {
        /// The job.
        by: Lease<'a>,
    },
}

/// A lease of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lease<'a> {
    /// The job's id.
    pub job: &'a str,
    /// Its fencing token.
    pub token: u64,
}

impl<'a> FolderOwner<'a> {
    /// The owner of the folder `key`; `None` for a folder of an unknown kind.
    pub fn parse(key: &'a str) -> Option<Self> {
        let parts: Vec<&str> = key.split('/').collect();
        match parts.as_slice() {
            ["uploads", capture] => Some(Self::Upload { capture }),
            ["captures", capture, lease] => Some(Self::Shard {
                capture,
                by: Lease::parse(lease)?,
            }),
            ["models", model, lease, _step] => Some(Self::Checkpoint {
                model,
                by: Lease::parse(lease)?,
            }),
            ["renders", job, token] => Some(Self::Render {
                by: Lease {
                    job,
                    token: token.parse().ok()?,
                },
            }),
            _ => None,
        }
    }

    /// The lease under which it was written; an upload has none.
    pub fn lease(self) -> Option<Lease<'a>> {
        match self {
            Self::Upload { .. } => None,
            Self::Shard { by, .. } | Self::Checkpoint { by, .. } | Self::Render { by } => Some(by),
        }
    }
}

impl<'a> Lease<'a> {
    /// The lease in `{job}-{token}`.
    fn parse(text: &'a str) -> Option<Self> {
        let (job, token) = text.rsplit_once('-')?;
        let token = token.parse().ok()?;
        Some(Self { job, token })
    }
}

/// The folder of the object `key`, such as of a manifest or shard that a row names.
pub fn folder(key: &str) -> &str {
    key.rsplit_once('/').map_or("", |(folder, _)| folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_read_as_they_are_made() {
        let by = Lease {
            job: "j-1",
            token: 7,
        };
        let made = [
            (
                shard("c", "j-1", 7),
                FolderOwner::Shard { capture: "c", by },
            ),
            (
                of_capture("c", "j-1", 7, CHECK),
                FolderOwner::Shard { capture: "c", by },
            ),
            (
                tradeoff("m", "j-1", 7, 40),
                FolderOwner::Checkpoint { model: "m", by },
            ),
            (render("j-1", 7, "0.png"), FolderOwner::Render { by }),
            (
                format!("{}/x", upload_folder("c")),
                FolderOwner::Upload { capture: "c" },
            ),
        ];
        for (key, expected) in made {
            let found = folder(&key);
            assert_eq!(FolderOwner::parse(found), Some(expected), "{key}");
            let depth = found.split('/').count() - 1;
            let root = found.split('/').next().unwrap_or_default();
            assert!(ROOTS.contains(&(root, depth)), "{key}");
        }
        for (key, expected) in [
            ("models/m/j-1/5/a", Some("models/m/j-1/5")),
            ("uploads/c/parts/3-1", Some("uploads/c")),
            ("models/m/j-1/5", None),
            ("yoto-store", None),
        ] {
            assert_eq!(collected_folder(key), expected, "{key}");
        }
        assert_eq!(writer_of_part(&upload_part("c", 3, 17)), Some((3, 17)));
        for other in [
            "uploads/c/parts/3",
            "uploads/c/parts/a-1",
            "uploads/c/parts/3-1/x",
            "uploads/c/3-1",
            "models/c/parts/3-1",
        ] {
            assert_eq!(writer_of_part(other), None, "{other}");
        }
        for other in ["", "uploads", "models/m/j/5", "renders/j/x", "lost+found/a"] {
            assert_eq!(FolderOwner::parse(other), None, "{other}");
        }
    }
}

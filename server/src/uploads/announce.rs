//! The beginning of an upload: every limit is checked before anything is written.

use super::paths::CapturePaths;
use crate::config::UploadLimits;
use crate::context::Context;
use crate::objects::checksum::is_sha256;
use prost::Message;
use prost_types::Timestamp;
use yoto_proto::media_plan::{CAPTURE_ARCHIVES, film_alone};
use yoto_proto::names::Collection;
use yoto_proto::v1::{self, CommittedFile, FileHeader, upload};
use yoto_proto::worker::v1::InputFile;
use yoto_proto::{limits, pose_track};
use yoto_request::RequestError;
use yoto_request::validation::{all, both};
use yoto_store::{NewUpload, RequestKey, Tenant, Upload, UploadedFile};

/// Opens an upload of `files` for a subject, or finds the one that `request` opened.
///
/// # Errors
/// When the files break a rule, there is no such subject, or the disk is nearly full.
pub(crate) async fn create(
    context: &Context,
    tenant: &Tenant,
    subject_id: String,
    files: Vec<FileHeader>,
    request: Option<RequestKey>,
) -> Result<Upload, RequestError> {
    if let Some(id) = context.store.answered(tenant, request.as_ref()).await? {
        return Ok(context.store.upload(tenant, &id).await?);
    }
    let films = context.store.reads_films(tenant).await?;
    let files = check(&context.config.upload, films, files)?;
    let bytes = files.iter().map(|file| file.bytes).sum();
    ensure_room(context, bytes).await?;
    let new = NewUpload { subject_id, files };
    let count = new.files.len();
    let id = context.store.create_upload(tenant, new, request).await?;
    tracing::info!(upload = id, files = count, bytes, "upload opened");
    Ok(context.store.upload(tenant, &id).await?)
}

/// The upload of `files` that [`create`] would open, without a name, after the same checks.
///
/// # Errors
/// As [`create`].
pub(crate) async fn validate(
    context: &Context,
    tenant: &Tenant,
    subject_id: String,
    files: Vec<FileHeader>,
) -> Result<v1::Upload, RequestError> {
    let subject = context.store.subject(tenant, &subject_id).await;
    let films = context.store.reads_films(tenant).await?;
    let files = check(&context.config.upload, films, files);
    let (subject, files) = both(subject.map_err(RequestError::from), files)?;
    let bytes = files.iter().map(|file| file.bytes).sum();
    ensure_room(context, bytes).await?;
    Ok(v1::Upload {
        subject: subject.name,
        state: upload::State::Open.into(),
        bytes,
        part_bytes: context.config.upload.part_bytes,
        ..v1::Upload::default()
    })
}

/// Refuses `bytes` more, if there is no room for them beside what open uploads still send.
async fn ensure_room(context: &Context, bytes: u64) -> Result<(), RequestError> {
    let coming = context.store.coming_bytes().await?;
    context.ensure_room(bytes.saturating_add(coming))
}

/// What a film without poses gets where no worker has a pose model.
const NO_POSE_MODEL: &str = "a film alone has no poses, and no worker of this service has a pose model to find them \
     (`yoto serve --pose-model`, `yoto worker --pose-model`)";

/// Checks that the files can be a capture together; a film alone where there are `films`.
fn check(
    limits: &UploadLimits,
    films: bool,
    files: Vec<FileHeader>,
) -> Result<Vec<UploadedFile>, RequestError> {
    let of_all = |message: String| Err(RequestError::invalid("files", message));
    if files.len() > limits.files {
        let most = limits.files;
        return of_all(format!(
            "{} files; a capture has at most {most}",
            files.len()
        ));
    }
    let (mut paths, mut bytes, mut listing) = (CapturePaths::default(), 0_u64, 0);
    let mut checked = Vec::with_capacity(files.len());
    let mut faults = Vec::new();
    for (number, file) in files.into_iter().enumerate() {
        let shown: String = file.path.chars().take(80).collect();
        let mut refuse = |field: &str, message: String| {
            let field = format!("files[{number}].{field}");
            let message = format!("{shown}: {message}");
            faults.push(Err(RequestError::invalid(field, message)));
        };
        if let Err(reason) = paths.add(&file.path) {
            refuse("path", reason);
        }
        if file.bytes > limits.file_bytes {
            let most = limits.file_bytes;
            refuse(
                "bytes",
                format!("{} bytes; a file has at most {most}", file.bytes),
            );
        } else {
            bytes = bytes.saturating_add(file.bytes);
        }
        if bytes > limits.capture_bytes {
            let most = limits.capture_bytes;
            refuse("bytes", format!("a capture has at most {most} bytes"));
            // The files after it would all be too much.
            break;
        }
        let file = UploadedFile {
            sha256: file.sha256.to_ascii_lowercase(),
            bytes: file.bytes,
            path: file.path,
        };
        if !is_sha256(&file.sha256) {
            refuse("sha256", "a SHA-256 is 64 hex digits".into());
        }
        // A message in a list costs its length, a tag, and up to four bytes for the length.
        listing += 5 + listed(&file).encoded_len() + limits::PIECE_LISTING_BYTES;
        if listing > limits::LISTING_BYTES {
            refuse("path", format!("too many files, {number} are before it"));
            break;
        }
        checked.push(file);
    }
    all::<()>(faults)?;
    let told = |path: &str| pose_track::FILES.contains(&path) || CAPTURE_ARCHIVES.contains(&path);
    let paths = checked.iter().map(|file| file.path.as_str());
    let film = film_alone(paths).is_some();
    if film && !films {
        return of_all(NO_POSE_MODEL.to_owned());
    }
    if !film && !checked.iter().any(|file| told(&file.path)) {
        let (tracks, archives) = (pose_track::FILES.join(", "), CAPTURE_ARCHIVES.join(", "));
        return of_all(format!("the capture has none of {tracks}, {archives}"));
    }
    Ok(checked)
}

/// An uploaded file in the lease of its ingest job, without its pieces.
fn listed(file: &UploadedFile) -> InputFile {
    InputFile {
        path: file.path.clone(),
        bytes: file.bytes,
        sha256: file.sha256.clone(),
        ..InputFile::default()
    }
}

/// An upload as its client sees it.
pub(crate) fn describe(limits: &UploadLimits, upload: &Upload) -> v1::Upload {
    let state = match upload.open {
        true => upload::State::Open,
        false => upload::State::Finished,
    };
    let committed = upload.files.iter().filter(|file| file.committed > 0);
    let ends = upload.write_time + limits.expiry.as_secs_f64();
    v1::Upload {
        name: Collection::Uploads.name(&upload.id),
        capture: Collection::Captures.name(&upload.id),
        subject: Collection::Subjects.name(&upload.subject_id),
        state: state.into(),
        bytes: upload.files.iter().map(|file| file.bytes).sum(),
        committed_bytes: upload.files.iter().map(|file| file.committed).sum(),
        committed: committed
            .map(|file| CommittedFile {
                path: file.path.clone(),
                bytes: file.committed,
            })
            .collect(),
        part_bytes: limits.part_bytes,
        expire_time: upload.open.then_some(Timestamp {
            seconds: ends.floor() as i64,
            nanos: 0,
        }),
    }
}

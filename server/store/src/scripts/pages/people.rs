//! People with the captures by which pages show them.

use crate::db::{Row, Tx, sql, state};
use crate::scripts::subjects;
use crate::{CaptureFiles, Person, StoreError, Tenant};
use yoto_proto::keys::{CHECK, THUMBNAIL};
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Capture, RenderedFile, capture};

/// The tenant's people among those with these ids, oldest first, each with the newest READY capture, or else the newest one. Of
/// a capture, what a page shows is read: its size, its job, the check's report and the thumbnail.
pub(crate) async fn of(
    tx: &mut Tx,
    tenant: &Tenant,
    ids: &[&str],
) -> Result<Vec<Person>, StoreError> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let mut query = sql(
        "SELECT s.*, c.id AS portrait, c.state AS portrait_state, c.frames, c.width, c.height,
             (SELECT j.id FROM jobs j WHERE j.capture = c.id ORDER BY j.ord DESC LIMIT 1) AS ingest_job,
             k.key AS check_key, k.bytes AS check_bytes, k.sha256 AS check_sha256,
             t.key AS thumbnail_key, t.bytes AS thumbnail_bytes, t.sha256 AS thumbnail_sha256
         FROM subject_catalogue s
             LEFT JOIN captures c ON c.ord = (SELECT n.ord FROM captures n WHERE n.subject = s.id
                 ORDER BY CASE WHEN n.state = 'READY' THEN 0 ELSE 1 END, n.ord DESC LIMIT 1)
             LEFT JOIN capture_objects k ON k.capture = c.id AND c.state = 'READY' AND k.file = $2
             LEFT JOIN capture_objects t ON t.capture = c.id AND c.state = 'READY' AND t.file = $3
         WHERE s.tenant = $1 AND s.id IN (",
    )
    .bind(tenant.id())
    .bind(CHECK)
    .bind(THUMBNAIL);
    query.push_all(ids.iter().copied());
    query.push(") ORDER BY s.ord");
    let rows = query.rows(tx, "reading people with their captures").await?;
    let people = rows.iter().map(|row| {
        Ok(Person {
            subject: subjects::read(row)?,
            portrait: portrait(row)?,
        })
    });
    people.collect()
}

fn portrait(row: &Row) -> Result<Option<CaptureFiles>, StoreError> {
    let Some(id) = row.maybe_text("portrait")? else {
        return Ok(None);
    };
    let objects = [
        (
            CHECK,
            row.object("check_key", "check_bytes", "check_sha256")?,
        ),
        (
            THUMBNAIL,
            row.object("thumbnail_key", "thumbnail_bytes", "thumbnail_sha256")?,
        ),
    ];
    let files = objects.into_iter().filter(|it| it.1.is_some());
    let files: Vec<RenderedFile> = files
        .map(|(file, object)| RenderedFile {
            file: file.to_owned(),
            object,
        })
        .collect();
    let name = Collection::Captures.name(&id);
    let object = |file: &str| match files.iter().any(|it| it.file == file) {
        true => names::object(&name, file),
        false => String::new(),
    };
    let job = row.maybe_text("ingest_job")?;
    let capture = Capture {
        subject: Collection::Subjects.name(&row.text("id")?),
        state: state(
            "captures.state",
            &row.text("portrait_state")?,
            capture::State::from_str_name,
        )? as i32,
        frames: row.number("frames")?,
        width: row.number("width")?,
        height: row.number("height")?,
        ingest_job: job.map_or_else(String::new, |job| Collection::Jobs.name(&job)),
        check: object(CHECK),
        thumbnail: object(THUMBNAIL),
        name: name.clone(),
        ..Capture::default()
    };
    Ok(Some(CaptureFiles { capture, files }))
}

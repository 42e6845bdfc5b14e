//! The picture behind a scene, decoded in the child: it comes from outside.

use super::failure::{IngestError, ReadFailure, machine};
use super::order::{Order, Outcome, Prepared, Progress, Task};
use super::settings::IngestSettings;
use super::supervise;
use image::RgbImage;
use std::path::Path;
use yoto_media::archive::Files;
use yoto_media::backdrop::decode;
use yoto_proto::checks::scene::{BACKDROP_PIXELS, BACKDROP_SIDE};
use yoto_proto::pose_track::violation;

/// Name of the picture in faults: the field of the order.
const FIELD: &str = "scene.backdrop";
/// Bytes of width and height before the pixels.
const HEAD: usize = 8;

/// Decodes `picture`, a PNG or JPEG, in a child process. `folder` is for the child only. `watch` is called as by
/// [`ingest`](super::ingest).
///
/// # Errors
/// Faults of the picture or of this machine, and errors of `watch`.
pub fn read_backdrop<E>(
    folder: &Path,
    picture: &[u8],
    settings: &IngestSettings,
    mut watch: impl FnMut(Option<&Progress>) -> Result<(), E>,
) -> Result<RgbImage, IngestError<E>> {
    let path = folder.join("backdrop");
    std::fs::write(&path, picture).map_err(|error| machine("writing the backdrop", &error))?;
    let order = Order {
        task: Task::Backdrop,
        files: Files::from([(FIELD.to_owned(), path)]),
        ..Order::new(folder, &settings.limits)
    };
    match supervise::run(settings, &order, &mut watch)? {
        Outcome::Done(_) => {}
        Outcome::Rejected(found) => {
            let found = found.into_iter().map(Into::into);
            return Err(IngestError::Rejected(found.collect()));
        }
        Outcome::Machine(message) => return Err(IngestError::Machine(message)),
    }
    let bytes = std::fs::read(order.backdrop())
        .map_err(|error| machine("reading the decoded backdrop", &error))?;
    // The child read untrusted bytes, so its output is checked.
    unpack(&bytes).ok_or_else(|| IngestError::Broken("the decoded backdrop".to_owned()))
}

/// The child's work.
pub(super) fn prepare(
    order: &Order,
    tell: &mut dyn FnMut(Progress),
) -> Result<Prepared, ReadFailure> {
    tell(Progress {
        file: FIELD.to_owned(),
        ..Progress::default()
    });
    let machine = |error: std::io::Error| ReadFailure::Machine(format!("the backdrop: {error}"));
    let path = order.files.get(FIELD);
    let path =
        path.ok_or_else(|| ReadFailure::Machine("an order without a backdrop".to_owned()))?;
    let bytes = std::fs::read(path).map_err(machine)?;
    let picture = decode(&bytes)
        .map_err(|message| ReadFailure::of(violation("INVALID", "render", None, FIELD, message)))?;
    std::fs::write(order.backdrop(), pack(&picture)).map_err(machine)?;
    Ok(Prepared::default())
}

/// Width and height as little-endian integers, then the pixels.
fn pack(picture: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEAD + picture.as_raw().len());
    bytes.extend(picture.width().to_le_bytes());
    bytes.extend(picture.height().to_le_bytes());
    bytes.extend(picture.as_raw());
    bytes
}

/// A packed picture; `None` if its size is not allowed, or is not that of its pixels.
fn unpack(bytes: &[u8]) -> Option<RgbImage> {
    let (width, rest) = bytes.split_first_chunk::<4>()?;
    let (height, pixels) = rest.split_first_chunk::<4>()?;
    let [width, height] = [width, height].map(|it| u32::from_le_bytes(*it));
    let count = u64::from(width) * u64::from(height);
    let allowed = (1..=BACKDROP_SIDE).contains(&width.max(height)) && count <= BACKDROP_PIXELS;
    let whole = allowed && pixels.len() as u64 == 3 * count;
    RgbImage::from_raw(width, height, pixels.to_vec()).filter(|_| whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, Rgb};
    use std::io::Cursor;
    use yoto_media::Limits;

    fn prepared(picture: &[u8]) -> (Order, Result<Prepared, ReadFailure>, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("backdrop");
        std::fs::write(&path, picture).expect("writes");
        let order = Order {
            task: Task::Backdrop,
            files: Files::from([(FIELD.to_owned(), path)]),
            ..Order::new(folder.path(), &Limits::default())
        };
        let prepared = prepare(&order, &mut |_| {});
        (order, prepared, folder)
    }

    #[test]
    fn a_backdrop_comes_back_as_it_was_and_a_bad_one_is_named() {
        let picture = RgbImage::from_fn(5, 3, |x, y| Rgb([x as u8, y as u8, 7]));
        let mut png = Cursor::new(Vec::new());
        picture
            .write_to(&mut png, ImageFormat::Png)
            .expect("encodes");
        let (order, done, _folder) = prepared(&png.into_inner());
        done.expect("is decoded");
        let bytes = std::fs::read(order.backdrop()).expect("is written");
        assert_eq!(unpack(&bytes), Some(picture));
        let (_, refused, _folder) = prepared(b"no picture");
        let Err(ReadFailure::Rejected(found)) = refused else {
            panic!("{refused:?}");
        };
        assert_eq!(found[0].field, FIELD);
    }

    #[test]
    fn what_a_child_wrote_is_checked() {
        let good = pack(&RgbImage::new(2, 2));
        assert!(unpack(&good).is_some());
        assert!(unpack(&good[..good.len() - 1]).is_none());
        assert!(unpack(&[&good[..], &[0]].concat()).is_none());
        assert!(unpack(&good[..5]).is_none());
        let large = [(BACKDROP_SIDE + 1).to_le_bytes(), 1_u32.to_le_bytes()].concat();
        let pixels = vec![0; 3 * (BACKDROP_SIDE as usize + 1)];
        assert!(unpack(&[large, pixels].concat()).is_none());
    }
}

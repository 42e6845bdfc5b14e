//! Films as animated WebP: all colours, and transparency.

use anyhow::{Context, ensure};
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use webp_animation::{Encoder, EncoderOptions, EncodingConfig, EncodingType, LossyEncodingConfig};

/// Quality of the colours, from 0 to 100. At 90, steps between the blocks of a smooth face are hard to see.
const QUALITY: f32 = 90.0;

/// Writes the `pictures`, which repeat without an end. Opacity is kept exactly, colours nearly.
pub(crate) fn write(pictures: &[PathBuf], fps: f64, file: &File) -> anyhow::Result<()> {
    let mut film: Option<((u32, u32), Encoder)> = None;
    for (index, path) in pictures.iter().enumerate() {
        let reading = || format!("reading {}", path.display());
        let picture = image::open(path).with_context(reading)?.to_rgba8();
        let size = picture.dimensions();
        let (first, encoder) = match &mut film {
            Some(film) => film,
            None => {
                let encoder = Encoder::new_with_options(size, options()).context("the encoder")?;
                film.insert((size, encoder))
            }
        };
        ensure!(
            size == *first,
            "{}: {size:?} pixels, and the first picture has {first:?}",
            path.display()
        );
        let shown = encoder.add_frame(&picture, milliseconds(index, fps));
        shown.with_context(reading)?;
    }
    let (_, encoder) = film.context("no pictures for a film")?;
    let bytes = encoder
        .finalize(milliseconds(pictures.len(), fps))
        .context("the end")?;
    Ok((&*file).write_all(&bytes)?)
}

fn options() -> EncoderOptions {
    EncoderOptions {
        encoding_config: Some(EncodingConfig {
            encoding_type: EncodingType::Lossy(LossyEncodingConfig::default()),
            quality: QUALITY,
            ..EncodingConfig::default()
        }),
        ..EncoderOptions::default()
    }
}

/// The beginning of picture number `index` of a film.
fn milliseconds(index: usize, fps: f64) -> i32 {
    // A film of a month has fewer than 2³¹.
    (1000.0 * index as f64 / fps).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::film::{is_film, may_be_transparent, write};
    use std::path::Path;
    use webp_animation::Decoder;

    fn pictures(folder: &Path, sizes: [u32; 2]) -> Vec<PathBuf> {
        let colours = [[200, 30, 30, 255], [30, 30, 200, 128]];
        let each = colours.into_iter().zip(sizes);
        let each = each.enumerate().map(|(index, (colour, size))| {
            let path = folder.join(format!("{index}.png"));
            let picture = image::RgbaImage::from_pixel(size, 16, image::Rgba(colour));
            picture.save(&path).expect("written");
            path
        });
        each.collect()
    }

    #[test]
    fn a_film_is_read_back_with_its_times_and_opacity() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("film.webp");
        assert!(is_film(&out) && may_be_transparent(&out));
        write(&pictures(folder.path(), [24, 24]), 12.0, &out).expect("written");
        let bytes = std::fs::read(&out).expect("a file");
        let decoder = Decoder::new(&bytes).expect("a film");
        let seen: Vec<_> = decoder.into_iter().collect();
        let times: Vec<i32> = seen.iter().map(|it| it.timestamp()).collect();
        assert_eq!(times, [83, 167], "the end of each");
        for (frame, colour) in seen.iter().zip([[200u8, 30, 30, 255], [30, 30, 200, 128]]) {
            let middle = 4 * (8 * 24 + 12);
            let pixel = &frame.data()[middle..middle + 4];
            assert_eq!(pixel[3], colour[3]);
            for (found, wanted) in pixel.iter().zip(colour) {
                assert!(found.abs_diff(wanted) <= 6, "{pixel:?}, not {colour:?}");
            }
        }
    }

    #[test]
    fn pictures_of_two_sizes_are_no_film() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("film.webp");
        let refused = write(&pictures(folder.path(), [24, 20]), 12.0, &out);
        let message = format!("{:#}", refused.expect_err("two sizes"));
        assert!(message.contains("1.png: (20, 16) pixels"), "{message}");
        assert!(!out.exists());
    }
}

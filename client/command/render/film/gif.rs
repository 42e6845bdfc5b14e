//! Films as GIF, with 256 colours, for viewers that play no other format.

use anyhow::Context;
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame};
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

/// Effort for the colours of a GIF, from 1, the best, to 30. At 10, the encoder looks at every tenth pixel.
const GIF_SPEED: i32 = 10;

/// Shortest duration of a picture in a GIF, hundredths of a second: browsers show shorter ones for ten.
const GIF_LEAST: u32 = 2;

/// GIF counts hundredths of a second. Pictures that have less than [`GIF_LEAST`] are left out, so that the film
/// keeps its speed.
pub(crate) fn write(pictures: &[PathBuf], fps: f64, file: &File) -> anyhow::Result<()> {
    let mut encoder = GifEncoder::new_with_speed(BufWriter::new(file), GIF_SPEED);
    encoder.set_repeat(Repeat::Infinite)?;
    for (index, hundredths) in gif_times(pictures.len(), fps) {
        let path = &pictures[index];
        let reading = || format!("reading {}", path.display());
        let picture = image::open(path).with_context(reading)?.to_rgba8();
        let shown = Delay::from_numer_denom_ms(10 * hundredths, 1);
        encoder.encode_frame(Frame::from_parts(picture, 0, 0, shown))?;
    }
    Ok(())
}

/// The indices of the pictures that a GIF has, and how long each is shown, hundredths of a second.
fn gif_times(pictures: usize, fps: f64) -> Vec<(usize, u32)> {
    let mut times = Vec::new();
    let (mut first, mut shown) = (0, 0);
    for index in 0..pictures {
        let end = (100.0 * (index + 1) as f64 / fps).round() as u32;
        if end - shown >= GIF_LEAST {
            times.push((first, end - shown));
            (first, shown) = (index + 1, end);
        }
    }
    if times.is_empty() && pictures > 0 {
        times.push((0, GIF_LEAST));
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::film::{is_film, write};

    #[test]
    fn a_gif_keeps_the_speed_of_the_film() {
        assert_eq!(gif_times(3, 15.0), [(0, 7), (1, 6), (2, 7)]);
        assert_eq!(gif_times(6, 100.0), [(0, 2), (2, 2), (4, 2)]);
        assert_eq!(gif_times(1, 120.0), [(0, 2)]);
        assert_eq!(gif_times(0, 15.0), []);
    }

    #[test]
    fn a_gif_is_read_back_with_its_pictures() {
        let folder = tempfile::tempdir().expect("a folder");
        let colours = [[200, 30, 30], [30, 30, 200]];
        let pictures = colours.map(|colour| {
            let path = folder.path().join(format!("{}.png", colour[0]));
            let picture = image::RgbImage::from_pixel(9, 5, image::Rgb(colour));
            picture.save(&path).expect("written");
            path
        });
        let out = folder.path().join("film.GIF");
        assert!(is_film(&out));
        write(&pictures, 25.0, &out).expect("written");
        let file = std::io::BufReader::new(File::open(&out).expect("a file"));
        let decoder = image::codecs::gif::GifDecoder::new(file).expect("a GIF");
        let frames = image::AnimationDecoder::into_frames(decoder).collect_frames();
        let frames = frames.expect("frames");
        let seen: Vec<_> = frames
            .iter()
            .map(|it| (it.delay().numer_denom_ms().0, it.buffer().get_pixel(4, 2).0))
            .collect();
        assert_eq!(seen, [(40, [200, 30, 30, 255]), (40, [30, 30, 200, 255])]);
    }
}

//! Plots of cost against gain, as SVG and PNG, with an embedded font.
//!
//! [`axis`] places numbers on the page, [`labels`] places text, [`draw`] draws both. One drawing
//! is used for both formats.

mod axis;
mod draw;
mod labels;

use crate::pictures;
use anyhow::{Context, ensure};
use plotters::prelude::{BitMapBackend, IntoDrawingArea, SVGBackend};
use plotters::style::{FontStyle, register_font};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Size of the page, pixels of the SVG.
const SIZE: (u32, u32) = (1000, 640);
/// Pixels of the PNG for each of the SVG.
const PNG_SCALE: f64 = 1.6;

/// A plot: cost to the right on a logarithmic axis, gain upwards on a linear one.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Title.
    pub title: String,
    /// Conditions, and the meaning of its labels.
    pub subtitle: String,
    /// Title of the cost, with its unit.
    pub cost: String,
    /// Title of the gain, with its unit.
    pub gain: String,
    /// The series, each in its own colour.
    pub series: Vec<Series>,
}

/// Points of one kind.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// In any order.
    pub marks: Vec<Mark>,
}

/// A point.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Above 0.
    pub cost: f64,
    /// Any finite number.
    pub gain: f64,
    /// Whether the point is on the front, which is drawn large.
    pub best: bool,
    /// Whether a line joins the point to the other such points of its series.
    pub joined: bool,
    /// Text beside the point, if there is room.
    pub label: Option<String>,
}

/// Writes `plot` as `NAME.svg` and `NAME.png` into `folder`.
///
/// # Errors
/// When there are no points, a point is not on the axes, or a file can't be written.
pub fn write(plot: &Plot, folder: &Path, name: &str) -> anyhow::Result<[PathBuf; 2]> {
    register()?;
    let svg = folder.join(name).with_extension("svg");
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw::draw(plot, &area, 1.0).with_context(|| format!("drawing {}", svg.display()))?;
    }
    std::fs::write(&svg, text).with_context(|| format!("writing {}", svg.display()))?;

    let png = folder.join(name).with_extension("png");
    let side = |length: u32| (f64::from(length) * PNG_SCALE).round() as u32;
    let (width, height) = (side(SIZE.0), side(SIZE.1));
    let mut pixels = vec![255; 3 * width as usize * height as usize];
    {
        let backend = BitMapBackend::with_buffer(&mut pixels, (width, height));
        draw::draw(plot, &backend.into_drawing_area(), PNG_SCALE)
            .with_context(|| format!("drawing {}", png.display()))?;
    }
    let picture = pictures::rgb(name, width as usize, height as usize, &pixels)?;
    pictures::write(&png, &picture)?;
    Ok([svg, png])
}

/// Registers the font of both formats.
fn register() -> anyhow::Result<()> {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    let registered = REGISTERED.get_or_init(|| {
        register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular()).is_ok()
    });
    ensure!(registered, "the plots' font can't be read");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(marks: Vec<Mark>) -> Plot {
        Plot {
            title: "Title".into(),
            subtitle: "on <this> & that".into(),
            cost: "seconds".into(),
            gain: "dB".into(),
            series: vec![Series {
                name: "fast".into(),
                marks,
            }],
        }
    }

    fn mark(cost: f64, gain: f64, label: Option<&str>) -> Mark {
        Mark {
            cost,
            gain,
            best: label.is_some(),
            joined: label.is_some(),
            label: label.map(Into::into),
        }
    }

    #[test]
    fn both_files_hold_the_points_and_their_labels() {
        let dir = tempfile::tempdir().expect("a folder");
        let marks = vec![
            mark(0.01, 20.0, Some("cheap one")),
            mark(0.3, 31.5, Some("dear one")),
            mark(0.2, 25.0, None),
        ];
        let [svg, png] = write(&plot(marks), dir.path(), "p").expect("writes");
        let text = std::fs::read_to_string(svg).expect("reads");
        for part in [
            "cheap one",
            "dear one",
            "Title",
            "&lt;this&gt; &amp; that",
            "0.1",
        ] {
            assert!(text.contains(part), "{part} is not in the SVG");
        }
        let picture = image::open(png).expect("a PNG").to_rgb8();
        assert_eq!(picture.dimensions(), (1600, 1024));
        let inked = picture.pixels().filter(|it| it.0 != [255; 3]).count();
        assert!(
            (5_000..800_000).contains(&inked),
            "{inked} pixels are not white"
        );
    }

    #[test]
    fn what_has_no_place_is_named() {
        let dir = tempfile::tempdir().expect("a folder");
        let refused = |marks| {
            let error = write(&plot(marks), dir.path(), "p").expect_err("refused");
            format!("{error:#}")
        };
        assert!(refused(Vec::new()).contains("no points"));
        for bad in [mark(0.0, 1.0, None), mark(1.0, f64::NAN, None)] {
            let message = refused(vec![mark(1.0, 1.0, None), bad]);
            assert!(
                message.contains("fast") && message.contains("p.svg"),
                "{message}"
            );
        }
    }
}

//! The picture sheet of a check: frames with the skeleton, as given and under the most likely
//! correction, above all measures.

use super::canvas::{Colour, disc, fill, line};
use super::tiles::{self, CAPTION, SIDE};
use super::{Checked, text};
use image::{GenericImage, Rgb, RgbImage};
use yoto_capture::check::{Drawing, Grade};
use yoto_proto::pose_track::PoseTrack;

const COLUMNS: u32 = 6;
const GAP: u32 = 10;
const WIDTH: u32 = COLUMNS * (SIDE + GAP) + GAP;
/// Letters of the tables are drawn at twice their size.
const SCALE: u32 = 2;
const LINE: u32 = SCALE * text::LETTER + 6;
/// Height of the drawings of view coverage and timing.
const CHARTS: u32 = 420;
/// Width of the tables, pixels.
const TABLE: u32 = WIDTH - 380;

const PAPER: Colour = Rgb([24, 24, 28]);
const INK: Colour = Rgb([225, 225, 230]);
const FAINT: Colour = Rgb([150, 150, 160]);

fn colour(grade: Grade) -> Colour {
    match grade {
        Grade::Pass => Rgb([110, 220, 120]),
        Grade::Warn => Rgb([250, 200, 70]),
        Grade::Fail => Rgb([255, 90, 90]),
    }
}

/// A line of the table.
struct ReportLine {
    indent: u32,
    ink: Colour,
    words: String,
}

impl Checked {
    /// The picture sheet.
    ///
    /// # Errors
    /// A frame that can't be read.
    pub fn sheet(&self) -> anyhow::Result<RgbImage> {
        let mended = self.mended();
        let rows = self.rows(mended.as_ref())?;
        let lines = self.lines();
        let height = rows.len() as u32 * (SIDE + CAPTION + GAP + LINE)
            + (lines.len() as u32 * LINE).max(CHARTS)
            + 4 * LINE;
        let mut page = RgbImage::from_pixel(WIDTH, height, PAPER);
        let report = &self.report;
        let title = format!("{}: {}", self.name, report.grade.name().to_uppercase());
        text::write(&mut page, GAP, GAP, SCALE, colour(report.grade), &title);
        legend(&mut page, GAP + 30 * text::LETTER * SCALE, GAP + 4);
        let mut y = GAP + LINE;
        for (heading, ink, row) in rows {
            text::write(&mut page, GAP, y, SCALE, ink, &heading);
            y += LINE;
            for (column, tile) in (0..).zip(row) {
                // Rows hold at most COLUMNS tiles, and the page size is derived from theirs.
                page.copy_from(&tile, GAP + column * (SIDE + GAP), y)?;
            }
            y += SIDE + CAPTION + GAP;
        }
        y += GAP;
        self.headings(&mut page, TABLE + 190, y + 130);
        self.timing(&mut page, TABLE + 40, y + 270);
        for it in lines {
            text::write(&mut page, GAP + it.indent, y, SCALE, it.ink, &it.words);
            y += LINE;
        }
        Ok(page)
    }

    /// The track under the first correction found, and the options for it.
    fn mended(&self) -> Option<(PoseTrack, Vec<u32>, String)> {
        let causes = self.report.causes.iter();
        let (cause, correction) = causes
            .filter_map(|cause| Some((cause, cause.correction?)))
            .find(|(cause, _)| !cause.options.is_empty())?;
        let corrected = correction.apply(self.track()).ok()?;
        let masks = corrected.sources.iter().map(|it| it.mask).collect();
        Some((corrected.track, masks, cause.options.clone()))
    }

    fn rows(
        &self,
        mended: Option<&(PoseTrack, Vec<u32>, String)>,
    ) -> anyhow::Result<Vec<(String, Colour, Vec<RgbImage>)>> {
        let asked = if self.asked.is_identity() {
            "as given".to_owned()
        } else {
            format!("read with {}", self.asked)
        };
        let shown = if mended.is_some() {
            COLUMNS
        } else {
            2 * COLUMNS
        } as usize;
        let frames = &self.track().frames;
        let count = frames.len();
        let shown = shown.min(count);
        let positions: Vec<usize> = (0..shown)
            .map(|i| (2 * i + 1) * count / (2 * shown))
            .collect();
        // For each position of the corrected track, its mask's position here.
        let position_of = |index: u32| frames.binary_search_by_key(&index, |it| it.index).ok();
        let mended_at = |position: usize| {
            let (track, masks, _) = mended?;
            let index = frames.get(position)?.index;
            let at = track.frames.iter().position(|it| it.index == index)?;
            Some((at, position_of(*masks.get(at)?)?))
        };
        let masks = positions.iter().filter_map(|&it| Some(mended_at(it)?.1));
        let shown: Vec<usize> = positions.iter().copied().chain(masks).collect();
        let pictures = self.frames(&shown)?;
        let mut given = Vec::new();
        for &position in &positions {
            let Some(picture) = pictures.get(&position) else {
                continue;
            };
            let drawing = Drawing::of(self.track(), position)?;
            given.push(tiles::tile(picture, &drawing, frames[position].index));
        }
        let worst = self.report.grade;
        let Some((track, _, options)) = mended else {
            let second = given.split_off(given.len().min(COLUMNS as usize));
            let mut rows = vec![(asked, colour(worst), given)];
            if !second.is_empty() {
                rows.push((String::new(), INK, second));
            }
            return Ok(rows);
        };
        let mut better = Vec::new();
        for &position in &positions {
            let Some((at, mask)) = mended_at(position) else {
                continue;
            };
            let (Some(picture), Some(mask)) = (pictures.get(&position), pictures.get(&mask)) else {
                continue;
            };
            let mut frame = picture.clone();
            frame.mask.clone_from(&mask.mask);
            let index = frames[position].index;
            better.push(tiles::tile(&frame, &Drawing::of(track, at)?, index));
        }
        Ok(vec![
            (asked, colour(worst), given),
            (format!("with {options}"), colour(Grade::Pass), better),
        ])
    }

    /// The table of measures and causes.
    fn lines(&self) -> Vec<ReportLine> {
        let columns = (TABLE / (text::LETTER * SCALE)) as usize - 2;
        let letter = text::LETTER * SCALE;
        let mut lines = Vec::new();
        let wrapped = |indent: u32, ink: Colour, words: &str| -> Vec<ReportLine> {
            let room = columns - (indent / letter) as usize;
            let words = text::wrapped(words, room).into_iter();
            words
                .map(|words| ReportLine { indent, ink, words })
                .collect()
        };
        for cause in &self.report.causes {
            lines.extend(wrapped(
                0,
                colour(Grade::Fail),
                &format!("Most likely: {}", cause.sentence()),
            ));
        }
        for it in &self.report.measures {
            let words = format!(
                "{:<4} {:<22} {}",
                it.grade.name(),
                it.kind.title(),
                it.shown
            );
            lines.push(ReportLine {
                indent: 0,
                ink: colour(it.grade),
                words,
            });
            let told = self
                .report
                .causes
                .iter()
                .any(|cause| Some(cause.sentence()) == it.cause);
            if it.grade != Grade::Pass {
                lines.extend(wrapped(5 * letter, FAINT, &it.meaning));
                if let Some(cause) = it.cause.as_ref().filter(|_| !told) {
                    lines.extend(wrapped(5 * letter, INK, cause));
                }
                if !it.frames.is_empty() {
                    let frames: Vec<String> = it.frames.iter().map(u32::to_string).collect();
                    lines.extend(wrapped(
                        5 * letter,
                        INK,
                        &format!("frames {}", frames.join(" ")),
                    ));
                }
            }
        }
        lines
    }

    /// View coverage: a ring of 12 directions around the body, its front below.
    fn headings(&self, page: &mut RgbImage, x: u32, y: u32) {
        let most = self
            .report
            .headings
            .iter()
            .copied()
            .max()
            .unwrap_or(0)
            .max(1);
        let centre = [f64::from(x), f64::from(y)];
        text::write(page, x - 110, y - 124, SCALE, INK, "seen from");
        for (i, &count) in self.report.headings.iter().enumerate() {
            let angle = (30.0 * i as f64).to_radians();
            let along = [angle.sin(), angle.cos()];
            let at = |radius: f64| [0, 1].map(|axis| centre[axis] + radius * along[axis]);
            if count > 0 {
                let reach = 25.0 + 55.0 * count as f64 / most as f64;
                line(page, at(25.0), at(reach), 12.0, colour(Grade::Pass));
            } else {
                disc(page, at(30.0), 5.0, colour(Grade::Warn));
            }
        }
        text::write(page, x - 20, y + 98, 1, FAINT, "front");
        text::write(page, x + 94, y - 4, 1, FAINT, "left");
        disc(page, centre, 6.0, INK);
    }

    /// The gain in overlap for masks of later frames.
    fn timing(&self, page: &mut RgbImage, x: u32, y: u32) {
        let shifts = &self.report.mask_shifts;
        text::write(page, x, y, SCALE, INK, "mask shift");
        let most = shifts
            .iter()
            .map(|(_, gain)| gain.abs())
            .fold(1e-6, f64::max);
        let best = shifts.iter().map(|(_, gain)| *gain).fold(0.0, f64::max);
        for (i, (shift, gain)) in (0..).zip(shifts) {
            // The largest overlap is highest.
            let below = (best - gain) / (most + best);
            let height = 4 + ((1.0 - below) * 70.0) as u32;
            let ink = if *shift == 0 { INK } else { FAINT };
            fill(page, x + 12 * i, y + 110 - height, [9, height], ink);
            if shift % 4 == 0 {
                text::write(page, x + 12 * i - 4, y + 116, 1, FAINT, &shift.to_string());
            }
        }
    }
}

/// Legend of the lines' colours.
fn legend(page: &mut RgbImage, x: u32, y: u32) {
    let entries = [
        (tiles::OUTLINE, "mask"),
        (tiles::LEFT, "left"),
        (tiles::RIGHT, "right"),
        (tiles::MIDDLE, "middle"),
        (tiles::BOX, "box of rays"),
        (tiles::OUTSIDE, "joint outside the mask"),
    ];
    let mut x = x;
    for (ink, words) in entries {
        fill(page, x, y, [10, 10], ink);
        text::write(page, x + 14, y + 1, 1, INK, words);
        x += 14 + (words.len() as u32 + 3) * text::LETTER;
    }
}

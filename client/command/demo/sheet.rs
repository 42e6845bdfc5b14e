//! Contact sheets: many pictures on one page, as an overview of the results.

use super::people::{Actor, HeldOut};
use super::render::{HeldOutRenders, MOTION_STEP};
use image::{GenericImage, Rgb, RgbImage};
use std::path::{Path, PathBuf};
use yoto_media::picture_file;

/// Between a truth and its render, and around groups, pixels.
const NARROW: u32 = 2;
const WIDE: u32 = 8;
const PAPER: Rgb<u8> = Rgb([60, 60, 66]);
/// Pictures in a row of the motion sheet.
const MOTION_COLUMNS: usize = 8;

/// Path of the sheet of held-out cameras.
pub(super) fn novel_views(out: &Path) -> PathBuf {
    out.join("contact-sheet.png")
}

/// Path of the sheet of held-out poses.
pub(super) fn novel_poses(out: &Path) -> PathBuf {
    out.join("contact-sheet-poses.png")
}

/// Path of the sheet of the transferred motion.
pub(super) fn motion(out: &Path) -> PathBuf {
    out.join("motion-transfer-sheet.png")
}

/// Writes both held-out sheets: one row per person, pairs of truth and render.
pub(super) fn write_held_out(
    out: &Path,
    actors: &[Actor],
    renders: &[HeldOutRenders],
) -> anyhow::Result<()> {
    let people = || actors.iter().zip(renders);
    let views: Vec<_> = people()
        .map(|(actor, it)| pairs(&actor.novel_view, &it.novel_view))
        .collect::<Result<_, _>>()?;
    picture_file::write(&novel_views(out), &sheet(&views))?;
    let poses: Vec<_> = people()
        .map(|(actor, it)| pairs(&actor.novel_pose, &it.novel_pose))
        .collect::<Result<_, _>>()?;
    picture_file::write(&novel_poses(out), &sheet(&poses))?;
    Ok(())
}

/// Writes the motion sheet: the driver's video above, the other body in the same poses below.
pub(super) fn write_motion(out: &Path, driver: &Actor, renders: &[RgbImage]) -> anyhow::Result<()> {
    let (mut above, mut below) = (Vec::new(), Vec::new());
    for column in 0..MOTION_COLUMNS.min(renders.len()) {
        let index = column * renders.len() / MOTION_COLUMNS.min(renders.len());
        let (Some(render), Some(filmed)) = (
            renders.get(index),
            driver.film.get(index * MOTION_STEP as usize),
        ) else {
            continue;
        };
        above.push(vec![picture_file::rgb(
            "a film frame",
            filmed.width,
            filmed.height,
            &filmed.rgb,
        )?]);
        below.push(vec![render.clone()]);
    }
    picture_file::write(&motion(out), &sheet(&[above, below]))?;
    Ok(())
}

/// Path of the strip of people between two.
pub(super) fn between(out: &Path) -> PathBuf {
    out.join("between.png")
}

/// Writes that strip.
pub(super) fn write_between(out: &Path, renders: Vec<RgbImage>) -> anyhow::Result<()> {
    picture_file::write(&between(out), &sheet(&[vec![renders]]))?;
    Ok(())
}

/// Truth and render of each view, side by side.
fn pairs(
    views: &[HeldOut],
    renders: &[RgbImage],
) -> Result<Vec<Vec<RgbImage>>, picture_file::PictureError> {
    let pair = |(view, render): (&HeldOut, &RgbImage)| {
        let truth = picture_file::rgb(
            "a truth",
            view.truth.width,
            view.truth.height,
            &view.truth.rgb,
        )?;
        Ok(vec![truth, render.clone()])
    };
    views.iter().zip(renders).map(pair).collect()
}

/// Rows of groups of pictures: narrow gaps inside a group, wide ones around it.
fn sheet(rows: &[Vec<Vec<RgbImage>>]) -> RgbImage {
    let group_width = |group: &Vec<RgbImage>| -> u32 {
        group.iter().map(RgbImage::width).sum::<u32>() + NARROW * (group.len().max(1) as u32 - 1)
    };
    let row_width = |row: &Vec<Vec<RgbImage>>| {
        row.iter()
            .map(|group| group_width(group) + WIDE)
            .sum::<u32>()
            + WIDE
    };
    let row_height = |row: &Vec<Vec<RgbImage>>| {
        row.iter()
            .flatten()
            .map(RgbImage::height)
            .max()
            .unwrap_or(0)
    };
    let width = rows.iter().map(row_width).max().unwrap_or(WIDE);
    let height = rows.iter().map(|row| row_height(row) + WIDE).sum::<u32>() + WIDE;

    let mut page = RgbImage::from_pixel(width, height, PAPER);
    let mut y = WIDE;
    for row in rows {
        let mut x = WIDE;
        for group in row {
            let mut left = x;
            for picture in group {
                // The page size has the same terms, so every picture fits.
                let placed = page.copy_from(picture, left, y);
                debug_assert!(placed.is_ok(), "a picture at {left}, {y} leaves the page");
                left += picture.width() + NARROW;
            }
            x += group_width(group) + WIDE;
        }
        y += row_height(row) + WIDE;
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: u8) -> RgbImage {
        RgbImage::from_pixel(10, 6, Rgb([value; 3]))
    }

    #[test]
    fn people_stand_in_rows_and_pairs_in_columns() {
        let row = |value: u8| {
            vec![
                vec![picture(value), picture(value + 1)],
                vec![picture(value + 2), picture(value + 3)],
            ]
        };
        let page = sheet(&[row(100), row(200)]);
        let pair = 2 * 10 + NARROW;
        assert_eq!(page.dimensions(), (2 * pair + 3 * WIDE, 2 * 6 + 3 * WIDE));
        let second_row = WIDE + 6 + WIDE;
        for (x, y, value) in [
            (WIDE, WIDE, 100),
            (WIDE + 10 + NARROW, WIDE, 101),
            (WIDE + pair + WIDE, WIDE, 102),
            (WIDE + pair + WIDE + 10 + NARROW, second_row + 5, 203),
        ] {
            assert_eq!(page.get_pixel(x, y), &Rgb([value; 3]), "at {x}, {y}");
        }
        assert_eq!(page.get_pixel(WIDE + 10, WIDE), &PAPER);
    }

    #[test]
    fn rows_of_unlike_length_and_empty_sheets_are_fine() {
        let page = sheet(&[
            vec![vec![picture(1)]],
            vec![vec![picture(2)], vec![picture(3)]],
            vec![],
        ]);
        assert_eq!(page.dimensions(), (2 * 10 + 3 * WIDE, 2 * 6 + 4 * WIDE));
        assert_eq!(sheet(&[]).dimensions(), (WIDE, WIDE));
    }
}

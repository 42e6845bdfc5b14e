//! The part of an image that a mask covers.

/// A rectangle of pixels, from the first column and row to one past the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaskBox {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// One past the last column.
    pub x1: usize,
    /// One past the last row.
    pub y1: usize,
}

/// The bounding box of the pixels with any coverage; `None` for an empty mask.
///
/// # Panics
/// If the mask has fewer than `width * height` pixels.
pub fn mask_box(mask: &[u8], width: usize, height: usize) -> Option<MaskBox> {
    let mut found: Option<MaskBox> = None;
    for row in 0..height {
        let line = &mask[row * width..(row + 1) * width];
        let covered = |&m: &u8| m > 0;
        let ends = (
            line.iter().position(covered),
            line.iter().rposition(covered),
        );
        let (Some(first), Some(last)) = ends else {
            continue;
        };
        let so_far = found.get_or_insert(MaskBox {
            x0: first,
            y0: row,
            x1: last + 1,
            y1: row + 1,
        });
        so_far.x0 = so_far.x0.min(first);
        so_far.x1 = so_far.x1.max(last + 1);
        so_far.y1 = row + 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_holds_the_mask() {
        let mut mask = vec![0u8; 5 * 4];
        mask[5 + 3] = 1;
        mask[2 * 5 + 1] = 200;
        let region = MaskBox {
            x0: 1,
            y0: 1,
            x1: 4,
            y1: 3,
        };
        assert_eq!(mask_box(&mask, 5, 4), Some(region));
        assert_eq!(mask_box(&[0; 20], 5, 4), None);
    }
}

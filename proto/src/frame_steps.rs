//! Which frames of a motion a request chooses: some of them in equal steps.

/// Places in a motion of `frames` frames, from `first` on in steps of `step` (0 means 1): `wanted` of them, or all that
/// are left if 0.
///
/// # Errors
/// The number of frames that are left, if it is smaller than `wanted`.
pub fn chosen(frames: usize, first: usize, step: u32, wanted: u32) -> Result<Vec<usize>, usize> {
    let step = step.max(1) as usize;
    let left = frames.saturating_sub(first).div_ceil(step);
    match wanted as usize {
        0 => Ok((first..frames).step_by(step).collect()),
        wanted if wanted <= left => Ok((first..).step_by(step).take(wanted).collect()),
        _ => Err(left),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_chosen_in_steps_as_far_as_there_are_any() {
        assert_eq!(chosen(10, 3, 0, 0), Ok(vec![3, 4, 5, 6, 7, 8, 9]));
        assert_eq!(chosen(10, 1, 4, 0), Ok(vec![1, 5, 9]));
        assert_eq!(chosen(10, 1, 4, 2), Ok(vec![1, 5]));
        assert_eq!(chosen(10, 1, 4, 3), Ok(vec![1, 5, 9]));
        assert_eq!(chosen(10, 1, 4, 4), Err(3));
        assert_eq!(chosen(10, 12, 1, 0), Ok(vec![]));
        assert_eq!(chosen(10, 12, 1, 1), Err(0));
    }
}

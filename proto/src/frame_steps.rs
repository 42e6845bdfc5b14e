//! Which frames of a motion a request chooses: some of them in equal steps.

/// Indices into a motion of `frames` frames: `wanted` indices (0: all that are left) from `first` on, every
/// `step` frames (0 means 1).
///
/// # Errors
/// The number of frames that are left, if it is smaller than `wanted`.
fn chosen(frames: usize, first: usize, step: u32, wanted: u32) -> Result<Vec<usize>, usize> {
    let step = step.max(1) as usize;
    let left = frames.saturating_sub(first).div_ceil(step);
    match wanted as usize {
        0 => Ok((first..frames).step_by(step).collect()),
        wanted if wanted <= left => Ok((first..).step_by(step).take(wanted).collect()),
        _ => Err(left),
    }
}

/// Indices into a capture whose frames have the `numbers`: `wanted` indices (0: all that are left) from `first`
/// on, every `step` frames (0 means 1). With an `end`, at most `wanted` indices of frames before the first number
/// that is `end` or higher.
///
/// # Errors
/// The number of frames that are left, if it is smaller than `wanted`; with an `end`, only if it is 0.
pub fn chosen_below(
    numbers: impl ExactSizeIterator<Item = u32>,
    first: usize,
    step: u32,
    wanted: u32,
    end: Option<u32>,
) -> Result<Vec<usize>, usize> {
    let Some(end) = end else {
        return chosen(numbers.len(), first, step, wanted);
    };
    let below = numbers.skip(first).take_while(|number| *number < end);
    let mut indices = chosen(first + below.count(), first, step, 0)?;
    if wanted > 0 {
        indices.truncate(wanted as usize);
    }
    match indices.is_empty() {
        true => Err(0),
        false => Ok(indices),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_a_number_and_steps_are_stored_frames() {
        let chosen = |first, step, wanted, end| {
            let numbers = [60, 62, 64, 66, 68, 70].into_iter();
            chosen_below(numbers, first, step, wanted, end)
        };
        assert_eq!(chosen(0, 1, 0, Some(66)), Ok(vec![0, 1, 2]));
        assert_eq!(chosen(1, 2, 0, Some(69)), Ok(vec![1, 3]));
        assert_eq!(chosen(0, 1, 60, Some(120)), Ok(vec![0, 1, 2, 3, 4, 5]));
        assert_eq!(chosen(0, 1, 2, Some(120)), Ok(vec![0, 1]));
        assert_eq!(chosen(0, 1, 0, Some(60)), Err(0));
        assert_eq!(chosen(4, 1, 2, None), Ok(vec![4, 5]));
        assert_eq!(chosen(4, 1, 3, None), Err(2));
    }

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

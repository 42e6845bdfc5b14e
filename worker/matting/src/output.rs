//! A network's output as coverage from 0 to 1.

use rten::Value;
use rten_tensor::prelude::*;

/// Values outside 0 to 1 by more than this are logits. Rounding errors are smaller.
const BEYOND: f32 = 0.01;

/// Levels of coverage, `[rows, columns]`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coverage {
    pub rows: usize,
    pub columns: usize,
    pub levels: Vec<f32>,
}

/// The coverage in `value`. `logits` remembers whether the network's values are logits, which is known once one of
/// them is not between 0 and 1.
///
/// # Errors
/// The fault of the value, in words.
pub(crate) fn coverage(value: &Value, logits: &mut bool) -> Result<Coverage, String> {
    let tensor = value.as_tensor_view::<f32>();
    let tensor = tensor.ok_or_else(|| format!("is of {}, not of floats", value.dtype()))?;
    let shape = tensor.shape().to_vec();
    let (classes, rows, columns) = match shape[..] {
        [rows, columns] | [1, rows, columns] | [1, 1, rows, columns] | [1, rows, columns, 1] => {
            (1, rows, columns)
        }
        [1, 2, rows, columns] => (2, rows, columns),
        _ => {
            return Err(format!(
                "has the shape {shape:?}, not that of a matte [1, 1, height, width]"
            ));
        }
    };
    let values = tensor.to_vec();
    if rows == 0 || columns == 0 {
        return Err(format!("has the shape {shape:?}: it is empty"));
    }
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        let at = at % (rows * columns);
        return Err(format!(
            "is {} at column {}, row {}",
            values.get(at).copied().unwrap_or(f32::NAN),
            at % columns,
            at / columns
        ));
    }
    *logits |= values
        .iter()
        .any(|value| !(-BEYOND..=1.0 + BEYOND).contains(value));
    let level = |value: f32| match *logits {
        true => 1.0 / (1.0 + (-value).exp()),
        false => value.clamp(0.0, 1.0),
    };
    let levels = match classes {
        1 => values.into_iter().map(level).collect(),
        // Background and person. For logits, the softmax of two classes is the logistic function of their
        // difference; probabilities are used directly.
        _ => {
            let (background, person) = values.split_at(rows * columns);
            let pairs = background.iter().zip(person);
            pairs
                .map(|(background, person)| {
                    level(if *logits {
                        person - background
                    } else {
                        *person
                    })
                })
                .collect()
        }
    };
    Ok(Coverage {
        rows,
        columns,
        levels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(shape: &[usize], values: &[f32]) -> Value {
        Value::from_shape(shape, values.to_vec()).expect("a value")
    }

    #[test]
    fn shares_are_levels_and_logits_become_some() {
        let mut logits = false;
        let levels = coverage(&value(&[1, 1, 1, 2], &[0.25, 1.0]), &mut logits).expect("a matte");
        assert_eq!((levels.levels, logits), (vec![0.25, 1.0], false));
        let levels = coverage(&value(&[1, 2], &[0.0, 9.0]), &mut logits).expect("a matte");
        assert!(logits && levels.levels[0] == 0.5 && levels.levels[1] > 0.999);
        // They stay logits even if all values of a picture are between 0 and 1.
        let levels = coverage(&value(&[1, 1, 1], &[0.0]), &mut logits).expect("a matte");
        assert_eq!(levels.levels, [0.5]);
    }

    #[test]
    fn of_two_classes_the_second_is_the_person() {
        let mut logits = false;
        let classes = value(&[1, 2, 1, 2], &[0.9, 0.2, 0.1, 0.8]);
        let levels = coverage(&classes, &mut logits).expect("a matte");
        assert_eq!(levels.levels, [0.1, 0.8]);
        let classes = value(&[1, 2, 1, 2], &[4.0, -4.0, 4.0, 4.0]);
        let levels = coverage(&classes, &mut logits).expect("a matte").levels;
        assert!(levels[0] == 0.5 && levels[1] > 0.999, "{levels:?}");
    }

    #[test]
    fn what_is_no_matte_is_named() {
        let fault = |shape: &[usize], values: &[f32]| {
            coverage(&value(shape, values), &mut false).expect_err("no matte")
        };
        assert!(fault(&[1, 3, 2, 2], &[0.0; 12]).contains("[1, 3, 2, 2]"));
        assert!(fault(&[1, 0], &[]).contains("empty"));
        let text = fault(&[1, 1, 2, 2], &[0.0, 0.0, 0.0, f32::NAN]);
        assert!(text.contains("NaN at column 1, row 1"), "{text}");
        let whole = Value::from_shape([1, 1], vec![1i32]).expect("a value");
        assert!(coverage(&whole, &mut false).is_err_and(|text| text.contains("float")));
    }
}

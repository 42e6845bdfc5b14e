//! Compares results with those of a case, and prints the rows of the table.

use crate::parity::case::Case;
use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use std::collections::BTreeMap;

/// Default bound on errors of values.
pub(crate) const VALUES: f64 = 1e-5;
/// Default bound on errors of gradients.
pub(crate) const GRADIENTS: f64 = 1e-4;

/// The largest difference, relative to the largest expected magnitude.
pub(crate) fn relative_error(what: &str, ours: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(ours.len(), expected.len(), "{what}: another size");
    assert!(ours.iter().all(|v| v.is_finite()), "{what}: not finite");
    let largest = expected.iter().fold(0f64, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "{what}: expecting zeros proves nothing");
    let worst = ours
        .iter()
        .zip(expected)
        .map(|(a, b)| (f64::from(*a) - b).abs())
        .fold(0.0, f64::max);
    worst / largest
}

/// Errors of one case.
pub(crate) struct Check<'a> {
    case: &'a Case,
    values: Vec<(String, f64)>,
    gradients: Vec<(String, f64)>,
}

impl<'a> Check<'a> {
    pub(crate) fn new(case: &'a Case) -> Self {
        Self {
            case,
            values: Vec::new(),
            gradients: Vec::new(),
        }
    }

    fn error(&self, name: &str, ours: &[f32]) -> f64 {
        let what = format!("{}: {name}", self.case.name);
        relative_error(&what, ours, self.case.numbers(name))
    }

    /// Compares the output `name`.
    pub(crate) fn value<const D: usize>(&mut self, name: &str, ours: Tensor<D>) {
        self.numbers(name, &read(ours));
    }

    /// Compares the output `name`, in host memory.
    pub(crate) fn numbers(&mut self, name: &str, ours: &[f32]) {
        let error = self.error(&format!("expected.{name}"), ours);
        self.values.push((name.into(), error));
    }

    /// Compares the gradient to the input `name`.
    pub(crate) fn gradient<const D: usize>(&mut self, name: &str, ours: Option<Tensor<D>>) {
        let ours = read(ours.expect("an input that is tracked"));
        let error = self.error(&format!("gradient.{name}"), &ours);
        self.gradients.push((name.into(), error));
    }

    /// Compares the gradients of all parameters of `module` that the case has; unused parameters
    /// must have none.
    pub(crate) fn parameters(&mut self, module: &impl Module, grads: &GradientsParams) {
        let ours = by_path(module, Some(grads));
        let mut compared = 0;
        for (path, ours) in ours {
            let name = format!("gradient.{path}");
            if !self.case.names("gradient.").contains(&path.as_str()) {
                continue;
            }
            compared += 1;
            if self.case.numbers(&name).iter().all(|g| *g == 0.0) {
                assert!(ours.iter().all(|g| *g == 0.0), "{path} took part");
                continue;
            }
            let error = self.error(&name, &ours);
            self.gradients.push((path, error));
        }
        let expected = self
            .case
            .names("gradient.")
            .into_iter()
            .filter(|name| name.contains('.'))
            .count();
        assert_eq!(
            compared, expected,
            "{}: a parameter is missing",
            self.case.name
        );
    }

    /// Adds an error measured elsewhere to the values.
    pub(crate) fn measured(&mut self, name: &str, error: f64) {
        self.values.push((name.into(), error));
    }

    /// Prints the row and asserts its bounds.
    pub(crate) fn within(self, values: f64, gradients: f64) {
        let name = self.case.name;
        let worst = |errors: &[(String, f64)]| errors.iter().map(|e| e.1).reduce(f64::max);
        let shown = |error: Option<f64>| error.map_or("–".into(), |e| format!("{e:.1e}"));
        println!(
            "\n| {name} | {} | {} |",
            shown(worst(&self.values)),
            shown(worst(&self.gradients))
        );
        for (errors, bound) in [(&self.values, values), (&self.gradients, gradients)] {
            for (part, error) in errors {
                assert!(
                    *error <= bound,
                    "{name}: {part}: {error:.2e} over {bound:.0e}"
                );
            }
        }
    }
}

/// Values of a tensor.
pub(crate) fn read<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

struct Paths<'a> {
    grads: Option<&'a GradientsParams>,
    path: Vec<String>,
    found: BTreeMap<String, Vec<f32>>,
}

impl ModuleVisitor for Paths<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let numbers = match self.grads {
            None => read(param.val()),
            // Parameters outside the objective have no gradient.
            Some(grads) => match grads.get::<D>(param.id) {
                Some(grad) => read(grad),
                None => vec![0.0; param.val().shape().num_elements()],
            },
        };
        self.found.insert(self.path.join("."), numbers);
    }
}

/// All parameters by path, or with `grads`, their gradients.
pub(crate) fn by_path(
    module: &impl Module,
    grads: Option<&GradientsParams>,
) -> BTreeMap<String, Vec<f32>> {
    let mut paths = Paths {
        grads,
        path: Vec::new(),
        found: BTreeMap::new(),
    };
    module.visit(&mut paths);
    paths.found
}

//! The dissertation's block diagrams, drawn from the description in its text.

use super::block_diagram::{BlockDiagram, BoxId, Role, Route};

/// Model that a diagram is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// Mass on spring and damper.
    Sdof,
    /// Rigid shaft in a journal bearing.
    Bearing,
}

/// Domain in which parameters are identified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Identification from samples.
    Time,
    /// Identification from Fourier coefficients.
    Frequency,
}

/// Equation of the identified force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceEquation {
    /// M̂ ẍ + Ĉ ẋ + K̂ x, sample by sample.
    Continuous,
    /// Forward-difference state equation solved for the input.
    Discretised,
}

impl Machine {
    fn name(self) -> &'static str {
        match self {
            Machine::Sdof => "single degree of freedom",
            Machine::Bearing => "shaft in a journal bearing",
        }
    }

    fn force(self) -> &'static str {
        match self {
            Machine::Sdof => "F(t)",
            Machine::Bearing => "F_{x}(t), F_{y}(t)",
        }
    }

    fn truth(self) -> &'static str {
        match self {
            Machine::Sdof => "M, C, K",
            Machine::Bearing => "M, C_{xx} … C_{yy}, K_{xx} … K_{yy}",
        }
    }

    fn motion(self) -> &'static str {
        match self {
            Machine::Sdof => "M Ẍ + C Ẋ + K X = F",
            Machine::Bearing => "eqs. (4.2.2), (4.2.3)",
        }
    }

    fn response(self) -> &'static str {
        match self {
            Machine::Sdof => "X(t), Ẋ(t), Ẍ(t)",
            Machine::Bearing => "X, Ẋ, Ẍ and Y, Ẏ, Ÿ",
        }
    }

    fn unknowns(self) -> &'static str {
        match self {
            Machine::Sdof => "Ĉ, K̂ (M known)",
            Machine::Bearing => "Ĉ_{xx} … Ĉ_{yy}, K̂_{xx} … K̂_{yy}",
        }
    }

    fn estimator(self, domain: Domain) -> &'static str {
        match (self, domain) {
            (Machine::Sdof, Domain::Time) => "eq. (4.5.12)",
            (Machine::Sdof, Domain::Frequency) => "eq. (4.6.12)",
            (Machine::Bearing, Domain::Time) => "eq. (4.5.28)",
            (Machine::Bearing, Domain::Frequency) => "eq. (4.6.31)",
        }
    }

    fn force_equation(self, equation: ForceEquation) -> &'static str {
        match (self, equation) {
            (Machine::Sdof, ForceEquation::Continuous) => "eq. (4.8.2)",
            (Machine::Sdof, ForceEquation::Discretised) => "eq. (4.7.2)",
            (Machine::Bearing, ForceEquation::Continuous) => "eq. (4.8.3)",
            (Machine::Bearing, ForceEquation::Discretised) => "eq. (4.7.3)",
        }
    }
}

/// The first boxes of every diagram.
struct Simulation {
    truth: BoxId,
    excitation: BoxId,
    response: BoxId,
}

/// Draws excitation, integration and response in a row, and the true parameters above the
/// integration.
fn simulation(diagram: &mut BlockDiagram, machine: Machine) -> Simulation {
    let truth = diagram.block((1, 0), Role::Data, "True parameters", &[machine.truth()]);
    let excitation = diagram.block(
        (0, 1),
        Role::Data,
        "Schroeder excitation",
        &[machine.force(), "N_{t} samples, NPI periods"],
    );
    let integration = diagram.block(
        (1, 1),
        Role::Process,
        "Numerical integration",
        &[machine.motion(), "Runge–Kutta, Newmark, central", "difference, Houbolt, Wilson θ"],
    );
    let response = diagram.block((2, 1), Role::Data, "Response", &[machine.response()]);
    diagram.arrow(truth, integration, Route::Straight);
    diagram.arrow(excitation, integration, Route::Straight);
    diagram.arrow(integration, response, Route::Straight);
    Simulation { truth, excitation, response }
}

/// Boxes that the estimation adds to a diagram: the force that it uses, the parameters that it
/// identifies, and their row.
struct Estimation {
    force: BoxId,
    parameters: BoxId,
    row: usize,
}

/// Draws the boxes and arrows that lead from excitation and response to the identified parameters.
fn estimation(
    diagram: &mut BlockDiagram,
    machine: Machine,
    domain: Domain,
    from: &Simulation,
) -> Estimation {
    let (force, response, row) = match domain {
        Domain::Time => (from.excitation, from.response, 2),
        Domain::Frequency => {
            let lines = &["cosine and sine parts", "at n ω, n = 1 … N_{f}"];
            let force = diagram.block((0, 2), Role::Process, "Spectrum of the force", lines);
            let response = diagram.block((2, 2), Role::Process, "Spectrum of the response", lines);
            diagram.arrow(from.excitation, force, Route::Straight);
            diagram.arrow(from.response, response, Route::Straight);
            (force, response, 3)
        }
    };
    let estimator =
        diagram.block((2, row), Role::Process, "Least squares", &[machine.estimator(domain)]);
    let parameters =
        diagram.block((3, row), Role::Result, "Identified parameters", &[machine.unknowns()]);
    diagram.arrow(response, estimator, Route::Straight);
    diagram.arrow(force, estimator, Route::ColumnFirst);
    diagram.arrow(estimator, parameters, Route::Straight);
    Estimation { force, parameters, row }
}

/// Identification of parameters.
pub fn identification(machine: Machine, domain: Domain) -> String {
    let equation = match domain {
        Domain::Time => "time domain",
        Domain::Frequency => "frequency domain",
    };
    let mut diagram = BlockDiagram::new(format!(
        "Identification of parameters in the {equation}: {}",
        machine.name()
    ));
    let simulated = simulation(&mut diagram, machine);
    let estimated = estimation(&mut diagram, machine, domain, &simulated);
    let error =
        diagram.block((3, 1), Role::Comparison, "Deviation", &["|estimate − true| / |true|"]);
    diagram.arrow(simulated.truth, error, Route::RowFirst);
    diagram.arrow(estimated.parameters, error, Route::Straight);
    diagram.to_svg()
}

/// Identification of the exciting force with identified parameters.
pub fn force(machine: Machine, domain: Domain, equation: ForceEquation) -> String {
    let (name, needs) = match equation {
        ForceEquation::Continuous => ("continuous equation", "M Ẍ + Ĉ Ẋ + K̂ X"),
        ForceEquation::Discretised => ("discretised equation", "X and Ẋ at k and k + 1"),
    };
    let parameters = match domain {
        Domain::Time => "",
        Domain::Frequency => ", parameters from the frequency domain",
    };
    let title =
        format!("Identification of the force by the {name}{parameters}: {}", machine.name());
    let mut diagram = BlockDiagram::new(title);
    let simulated = simulation(&mut diagram, machine);
    let estimated = estimation(&mut diagram, machine, domain, &simulated);
    let heading = match equation {
        ForceEquation::Continuous => "Continuous equation",
        ForceEquation::Discretised => "Discretised equation",
    };
    let solver =
        diagram.block((3, 1), Role::Process, heading, &[machine.force_equation(equation), needs]);
    let identified = diagram.block((4, 1), Role::Result, "Identified force", &[&hatted(machine)]);
    let comparison = diagram.block(
        (4, estimated.row),
        Role::Comparison,
        "Spectra compared",
        &["|F̂(ω)| against |F(ω)|"],
    );
    diagram.arrow(simulated.response, solver, Route::Straight);
    diagram.arrow(estimated.parameters, solver, Route::Straight);
    diagram.arrow(solver, identified, Route::Straight);
    diagram.arrow(identified, comparison, Route::Straight);
    diagram.arrow(estimated.force, comparison, Route::Below);
    diagram.to_svg()
}

fn hatted(machine: Machine) -> String {
    machine.force().replace('F', "F̂")
}

/// Identification of modal parameters (appendix E).
pub fn modal() -> String {
    let mut diagram = BlockDiagram::new(
        "Identification of modal parameters in the time domain: two degrees of freedom",
    );
    let truth = diagram.block((1, 0), Role::Data, "True system", &["M, C, K (Steffen and Rade)"]);
    let theory = diagram.block((4, 0), Role::Data, "Theoretical modes", &["f_{d}, ζ, y_{2}/y_{1}"]);
    let excitation = diagram.block(
        (0, 1),
        Role::Data,
        "Schroeder excitation",
        &["F_{0} = 1 N", "N_{t} = 2048 samples"],
    );
    let integration = diagram.block(
        (1, 1),
        Role::Process,
        "Numerical integration",
        &["Runge–Kutta 4", "or Newmark"],
    );
    let response =
        diagram.block((2, 1), Role::Data, "Response", &["displacements", "and velocities"]);
    let estimator = diagram.block((2, 2), Role::Process, "Least squares", &["eq. (4.5.28)"]);
    let state_matrix = diagram.block((3, 2), Role::Data, "State matrix", &["M^{−1}K̂ and M^{−1}Ĉ"]);
    let eigen = diagram.block((3, 1), Role::Process, "Eigenvalue problem", &["A ψ = λ ψ"]);
    let modes = diagram.block((4, 1), Role::Result, "Identified modes", &["f_{d}, ζ, y_{2}/y_{1}"]);
    diagram.arrow(truth, integration, Route::Straight);
    diagram.arrow(truth, theory, Route::Straight);
    diagram.arrow(excitation, integration, Route::Straight);
    diagram.arrow(integration, response, Route::Straight);
    diagram.arrow(response, estimator, Route::Straight);
    diagram.arrow(excitation, estimator, Route::ColumnFirst);
    diagram.arrow(estimator, state_matrix, Route::Straight);
    diagram.arrow(state_matrix, eigen, Route::Straight);
    diagram.arrow(eigen, modes, Route::Straight);
    diagram.double_arrow(theory, modes);
    diagram.to_svg()
}

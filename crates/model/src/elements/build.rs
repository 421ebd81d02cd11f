//! From the description of a machine to its terms.

use std::collections::HashMap;

use nalgebra::{Complex, DMatrix};

use super::assembly::OwnLoad;
use super::{
    Assembly, Bearing, Coefficient, Element, FreeCoefficient, Input, InputColumn, Instruments,
    Machine, MachineError, MachineParameter, MatrixElement, Pattern, Power, SUPPORT, Sensor,
    SensorRow, Speed, Term,
};

pub(super) fn assembly(
    machine: &Machine,
    instruments: &Instruments,
) -> Result<Assembly, MachineError> {
    check_names(machine, instruments)?;
    let mut builder = Builder::new(machine, instruments.speed)?;
    for (name, element) in &machine.elements {
        builder.add(name, element)?;
    }
    builder.check_masses(machine)?;
    let unused = machine.parameters.iter().find(|(name, _)| !builder.shared.contains_key(name));
    if let Some((name, _)) = unused {
        return Err(MachineError::UnusedParameter { name: name.clone() });
    }
    if instruments.sensors.is_empty() {
        return Err(MachineError::NoInstrument { what: "sensors" });
    }
    if instruments.inputs.is_empty() && builder.loads.is_empty() {
        return Err(MachineError::NoInstrument { what: "inputs" });
    }
    let sensors = instruments.sensors.iter().map(|sensor| builder.sensor(sensor));
    let sensors = sensors.collect::<Result<_, _>>()?;
    let inputs = instruments.inputs.iter().map(|input| builder.input(input));
    let inputs = inputs.collect::<Result<_, _>>()?;
    let measured = machine.measured.iter().map(|dof| builder.dof("machine", "measured", dof));
    let measured = measured.collect::<Result<_, _>>()?;
    Ok(Assembly {
        dofs: machine.dofs.clone(),
        terms: builder.terms,
        sensors,
        inputs,
        loads: builder.loads,
        parameters: builder.parameters,
        speed: instruments.speed,
        measured,
    })
}

fn check_names(machine: &Machine, instruments: &Instruments) -> Result<(), MachineError> {
    if machine.dofs.is_empty() {
        return Err(MachineError::NoDof);
    }
    if machine.dofs.iter().any(|dof| dof == SUPPORT) {
        return Err(MachineError::Reserved);
    }
    let names: [(&'static str, Vec<&String>); 4] = [
        ("degree of freedom", machine.dofs.iter().collect()),
        ("element", machine.elements.iter().map(|(name, _)| name).collect()),
        ("parameter", machine.parameters.iter().map(|(name, _)| name).collect()),
        ("sensor", instruments.sensors.iter().map(|sensor| &sensor.name).collect()),
    ];
    for (what, mut names) in names {
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(MachineError::Repeated { what, name: pair[0].clone() });
        }
    }
    Ok(())
}

/// A coefficient with its unknown, if it is one.
#[derive(Clone, Copy)]
enum Factor {
    Known(f64),
    Unknown(usize),
}

struct Builder<'a> {
    machine: &'a Machine,
    index: HashMap<&'a str, usize>,
    /// Motion of each degree of freedom with the support: 1 or 0.
    direction: Vec<f64>,
    speed: Speed,
    terms: Vec<Term>,
    loads: Vec<OwnLoad>,
    parameters: Vec<MachineParameter>,
    shared: HashMap<String, usize>,
    /// Elements at each degree of freedom, and whether one of them is a mass.
    touched: Vec<(Vec<String>, bool)>,
    alpha: Factor,
    beta: Factor,
    loss_factor: Factor,
}

impl<'a> Builder<'a> {
    fn new(machine: &'a Machine, speed: Speed) -> Result<Self, MachineError> {
        let index: HashMap<&str, usize> =
            machine.dofs.iter().enumerate().map(|(at, name)| (name.as_str(), at)).collect();
        let zero = Factor::Known(0.0);
        let mut builder = Self {
            machine,
            index,
            direction: vec![1.0; machine.dofs.len()],
            speed,
            terms: Vec::new(),
            loads: Vec::new(),
            parameters: Vec::new(),
            shared: HashMap::new(),
            touched: vec![(Vec::new(), false); machine.dofs.len()],
            alpha: zero,
            beta: zero,
            loss_factor: zero,
        };
        if let Some(moving) = &machine.support_direction {
            builder.direction.fill(0.0);
            for dof in moving {
                let at = builder.dof("machine", "support_direction", dof)?;
                builder.direction[at] = 1.0;
            }
        }
        let damping = &machine.damping;
        builder.alpha = builder.factor("alpha", &damping.alpha)?;
        builder.beta = builder.factor("beta", &damping.beta)?;
        builder.loss_factor = builder.factor("loss_factor", &damping.loss_factor)?;
        Ok(builder)
    }

    /// Index of a degree of freedom that something names.
    fn dof(&self, what: &'static str, name: &str, dof: &str) -> Result<usize, MachineError> {
        self.index.get(dof).copied().ok_or_else(|| MachineError::UnknownDof {
            what,
            name: name.to_owned(),
            dof: dof.to_owned(),
            known: self.machine.dofs.join(", "),
        })
    }

    /// e_i − e_j of two ends, one of which may be the support, which moves in its direction only.
    fn difference(
        &self,
        what: &'static str,
        name: &str,
        [one, other]: [&str; 2],
    ) -> Result<Vec<(usize, f64)>, MachineError> {
        if one == other {
            let (name, dof) = (name.to_owned(), one.to_owned());
            return Err(MachineError::SameEnds { what, name, dof });
        }
        let support = self.machine.dofs.len();
        let pair = match (one, other) {
            (SUPPORT, dof) | (dof, SUPPORT) => {
                let at = self.dof(what, name, dof)?;
                let sign = if one == SUPPORT { -1.0 } else { 1.0 };
                return Ok(vec![(at, sign), (support, -sign * self.direction[at])]);
            }
            pair => pair,
        };
        Ok(vec![(self.dof(what, name, pair.0)?, 1.0), (self.dof(what, name, pair.1)?, -1.0)])
    }

    fn factor(&mut self, name: &str, coefficient: &Coefficient) -> Result<Factor, MachineError> {
        match coefficient {
            Coefficient::Known(value) if !value.is_finite() => {
                Err(MachineError::NotFinite { name: name.to_owned(), value: *value })
            }
            Coefficient::Known(value) => Ok(Factor::Known(*value)),
            Coefficient::Free(free) => Ok(Factor::Unknown(self.unknown(name, free)?)),
            Coefficient::Shared(parameter) => {
                if let Some(at) = self.shared.get(parameter) {
                    return Ok(Factor::Unknown(*at));
                }
                let described = self.machine.parameters.iter().find(|(of, _)| of == parameter);
                let (_, free) = described.ok_or_else(|| MachineError::UnknownParameter {
                    name: name.to_owned(),
                    parameter: parameter.clone(),
                })?;
                let at = self.unknown(parameter, free)?;
                self.shared.insert(parameter.clone(), at);
                Ok(Factor::Unknown(at))
            }
        }
    }

    fn unknown(&mut self, name: &str, free: &FreeCoefficient) -> Result<usize, MachineError> {
        let start = free.checked_start(name)?;
        if self.parameters.iter().any(|parameter| parameter.name == name) {
            return Err(MachineError::Repeated { what: "parameter", name: name.to_owned() });
        }
        let (min, max) = (free.min.unwrap_or(f64::NEG_INFINITY), free.max.unwrap_or(f64::INFINITY));
        let prior = free.prior;
        self.parameters.push(MachineParameter { name: name.to_owned(), start, min, max, prior });
        Ok(self.parameters.len() - 1)
    }

    /// Adds pattern × power × factors unless that is zero.
    fn push(&mut self, pattern: &Pattern, power: Power, factors: &[Factor]) {
        let (mut scale, mut parameters) = (1.0, Vec::new());
        for factor in factors {
            match factor {
                Factor::Known(value) => scale *= value,
                Factor::Unknown(at) => parameters.push(*at),
            }
        }
        if scale != 0.0 {
            self.terms.push(Term { pattern: pattern.clone(), power, scale, parameters });
        }
    }

    fn touch(&mut self, name: &str, entries: &[(usize, f64)], is_mass: bool) {
        for (at, _) in entries.iter().filter(|(at, _)| *at < self.machine.dofs.len()) {
            let (elements, has_mass) = &mut self.touched[*at];
            elements.push(format!("{name:?}"));
            *has_mass |= is_mass;
        }
    }

    fn add(&mut self, name: &str, element: &Element) -> Result<(), MachineError> {
        match element {
            Element::Mass { at, mass } => self.mass(name, at, mass),
            Element::Link { between, stiffness, damping, loss_factor } => {
                let ends = [between[0].as_str(), between[1].as_str()];
                self.link(name, ends, [stiffness, damping, loss_factor])
            }
            Element::Bearing(bearing) => self.bearing(name, bearing),
            Element::Matrices(matrices) => self.matrices(name, matrices),
            Element::Unbalance { at, real, imaginary } => {
                self.unbalance(name, at, [real, imaginary])
            }
        }
    }

    fn mass(&mut self, name: &str, at: &str, mass: &Coefficient) -> Result<(), MachineError> {
        let at = self.dof("element", name, at)?;
        let factor = self.factor(name, mass)?;
        let entries = vec![(at, 1.0)];
        self.touch(name, &entries, true);
        let relative = vec![(at, 1.0), (self.machine.dofs.len(), -self.direction[at])];
        let pattern = Pattern::Dyad { left: entries.clone(), right: entries.clone() };
        self.push(&pattern, Power::Mass, &[factor]);
        let pattern = Pattern::Dyad { left: entries, right: relative };
        self.push(&pattern, Power::Damping, &[self.alpha, factor]);
        Ok(())
    }

    fn link(
        &mut self,
        name: &str,
        ends: [&str; 2],
        [stiffness, damping, loss_factor]: [&Coefficient; 3],
    ) -> Result<(), MachineError> {
        let entries = self.difference("element", name, ends)?;
        self.touch(name, &entries, false);
        let used = [stiffness, damping].into_iter().filter(|value| !value.is_zero()).count();
        if used == 0 {
            let problem = "a link needs a stiffness `k` or a damping `c`".to_owned();
            return Err(MachineError::Element { name: name.to_owned(), problem });
        }
        let named = |letter: &str| match used + usize::from(!loss_factor.is_zero()) {
            1 => name.to_owned(),
            _ => format!("{name}.{letter}"),
        };
        let k = self.factor(&named("k"), stiffness)?;
        let c = self.factor(&named("c"), damping)?;
        let eta = match loss_factor.is_zero() {
            true => self.loss_factor,
            false => self.factor(&named("eta"), loss_factor)?,
        };
        let pattern = Pattern::Dyad { left: entries.clone(), right: entries };
        self.push(&pattern, Power::Stiffness, &[k]);
        self.push(&pattern, Power::Damping, &[c]);
        self.push(&pattern, Power::Hysteresis, &[k, eta]);
        self.push(&pattern, Power::Damping, &[k, self.beta]);
        Ok(())
    }

    fn bearing(&mut self, name: &str, bearing: &Bearing) -> Result<(), MachineError> {
        let mut ends = Vec::new();
        for direction in 0..2 {
            let other = bearing.to.as_ref().map_or(SUPPORT, |to| to[direction].as_str());
            ends.push(self.difference("element", name, [bearing.at[direction].as_str(), other])?);
            self.touch(name, &ends[direction], false);
        }
        let matrices = [
            ("k", Power::Stiffness, &bearing.stiffness),
            ("c", Power::Damping, &bearing.damping),
            ("m", Power::Mass, &bearing.mass),
        ];
        for (letter, power, coefficients) in matrices {
            let places = [("xx", 0, 0), ("xy", 0, 1), ("yx", 1, 0), ("yy", 1, 1)];
            for ((place, row, column), coefficient) in places.into_iter().zip(coefficients) {
                let factor = self.factor(&format!("{name}.{letter}{place}"), coefficient)?;
                let (left, right) = (ends[row].clone(), ends[column].clone());
                self.push(&Pattern::Dyad { left, right }, power, &[factor]);
            }
        }
        Ok(())
    }

    fn matrices(&mut self, name: &str, element: &MatrixElement) -> Result<(), MachineError> {
        let dofs = element.dofs.iter().map(|dof| self.dof("element", name, dof));
        let dofs: Vec<usize> = dofs.collect::<Result<_, _>>()?;
        let entries: Vec<(usize, f64)> = dofs.iter().map(|at| (*at, 1.0)).collect();
        self.touch(name, &entries, element.mass.is_some());
        let known = Factor::Known(1.0);
        let parts = [
            ("mass", &element.mass, Power::Mass),
            ("damping", &element.damping, Power::Damping),
            ("stiffness", &element.stiffness, Power::Stiffness),
            ("gyroscopic", &element.gyroscopic, Power::Gyroscopic),
        ];
        for (what, part, power) in parts {
            let Some((matrix, coefficient)) = part else { continue };
            self.check_matrix(name, what, matrix, dofs.len())?;
            let factor = self.factor(&format!("{name}.{what}"), coefficient)?;
            let relative = self.block(&dofs, matrix, true);
            match power {
                Power::Mass => {
                    let absolute = self.block(&dofs, matrix, false);
                    self.push(&absolute, power, &[factor, known]);
                    self.push(&relative, Power::Damping, &[factor, self.alpha]);
                }
                Power::Stiffness => {
                    self.push(&relative, power, &[factor]);
                    self.push(&relative, Power::Hysteresis, &[factor, self.loss_factor]);
                    self.push(&relative, Power::Damping, &[factor, self.beta]);
                }
                Power::Gyroscopic if self.speed == Speed::None => {
                    return Err(MachineError::NoSpeed { what: "element", name: name.to_owned() });
                }
                Power::Gyroscopic => {
                    let absolute = self.block(&dofs, matrix, false);
                    self.push(&absolute, power, &[factor]);
                }
                _ => self.push(&relative, power, &[factor]),
            }
        }
        Ok(())
    }

    fn check_matrix(
        &self,
        name: &str,
        what: &str,
        matrix: &DMatrix<f64>,
        order: usize,
    ) -> Result<(), MachineError> {
        let (rows, columns) = matrix.shape();
        if (rows, columns) != (order, order) {
            let problem = format!(
                "the {what} matrix is {rows}×{columns}, but `dofs` has {order} degrees of freedom"
            );
            return Err(MachineError::Element { name: name.to_owned(), problem });
        }
        match matrix.iter().find(|value| !value.is_finite()) {
            Some(&value) => Err(MachineError::NotFinite { name: format!("{name}.{what}"), value }),
            None => Ok(()),
        }
    }

    /// A matrix that acts on the motion, or on that relative to the support.
    fn block(&self, dofs: &[usize], matrix: &DMatrix<f64>, relative: bool) -> Pattern {
        let support = matrix.row_iter().map(|row| {
            let moved = row.iter().zip(dofs).map(|(value, at)| value * self.direction[*at]);
            if relative { -moved.sum::<f64>() } else { 0.0 }
        });
        let support = support.collect();
        Pattern::Block { dofs: dofs.to_vec(), matrix: matrix.clone(), support }
    }

    fn unbalance(
        &mut self,
        name: &str,
        at: &[String; 2],
        parts: [&Coefficient; 2],
    ) -> Result<(), MachineError> {
        if self.speed == Speed::None {
            return Err(MachineError::NoSpeed { what: "element", name: name.to_owned() });
        }
        let at = [self.dof("element", name, &at[0])?, self.dof("element", name, &at[1])?];
        let units = [("real", Complex::new(1.0, 0.0)), ("imaginary", Complex::new(0.0, 1.0))];
        for ((what, unit), part) in units.into_iter().zip(parts) {
            match self.factor(&format!("{name}.{what}"), part)? {
                Factor::Known(0.0) => {}
                Factor::Known(value) => {
                    self.loads.push(OwnLoad { at, scale: unit * value, parameter: None });
                }
                Factor::Unknown(parameter) => {
                    self.loads.push(OwnLoad { at, scale: unit, parameter: Some(parameter) });
                }
            }
        }
        Ok(())
    }

    /// Every degree of freedom needs an element and a mass, even one of 0.
    fn check_masses(&self, machine: &Machine) -> Result<(), MachineError> {
        for (dof, (elements, has_mass)) in machine.dofs.iter().zip(&self.touched) {
            if machine.measured.contains(dof) {
                continue;
            }
            if elements.is_empty() {
                return Err(MachineError::Detached { dof: dof.clone() });
            }
            if !has_mass {
                let (dof, elements) = (dof.clone(), elements.join(", "));
                return Err(MachineError::NoMass { dof, elements });
            }
        }
        Ok(())
    }

    fn sensor(&self, sensor: &Sensor) -> Result<SensorRow, MachineError> {
        let name = &sensor.name;
        if !sensor.gain.is_finite() {
            return Err(MachineError::NotFinite { name: name.clone(), value: sensor.gain });
        }
        if sensor.gain == 0.0 {
            return Err(MachineError::NoGain { name: name.clone() });
        }
        let mut entries = match &sensor.relative_to {
            Some(other) => self.difference("sensor", name, [&sensor.at, other])?,
            None => vec![(self.dof("sensor", name, &sensor.at)?, 1.0)],
        };
        entries.iter_mut().for_each(|(_, weight)| *weight *= sensor.gain);
        Ok(SensorRow { name: name.clone(), entries, quantity: sensor.quantity })
    }

    fn input(&self, input: &Input) -> Result<InputColumn, MachineError> {
        let what = "input";
        Ok(match input {
            Input::Force { name, at, against } => InputColumn::Force(match against {
                Some(other) => self.difference(what, name, [at, other])?,
                None => vec![(self.dof(what, name, at)?, 1.0)],
            }),
            Input::Support { quantity, .. } => InputColumn::Support(*quantity),
            Input::Unbalance { name, at } => {
                if self.speed == Speed::None {
                    return Err(MachineError::NoSpeed { what, name: name.clone() });
                }
                let [x, y] = at;
                InputColumn::Unbalance([self.dof(what, name, x)?, self.dof(what, name, y)?])
            }
        })
    }
}

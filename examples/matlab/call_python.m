% Elevon as a Python package, inside MATLAB (R2022b or later). Once, before anything of Python:
%   pyenv('Version', '/path/to/.venv/bin/python')
% Octave has no such door: use elevon_command there.
sine = py.dict(pyargs('kind', 'sine', 'amplitude', '5 deg', 'frequency', '1 Hz'));
command = py.dict(pyargs('terms', py.list({sine})));
scenario = py.dict(pyargs('duration', '0.5 s', 'command', command));
recording = py.elevon.simulate('torino-rotary', scenario, pyargs('fidelity', 'low', ...
                               'record', 'output_position@400 Hz'));
position = py.operator.getitem(recording, 'output_position');
run = timetable(seconds(double(position.time))', double(position.values)', ...
                'VariableNames', {'output_position'});
run.Properties.VariableUnits = {char(position.unit)};

% A session, stepped by MATLAB.
session = py.elevon.Session('torino-rotary', pyargs('fidelity', 'low', 'mode', 'speed'));
session.set(pyargs('command', '100 rpm'));
for k = 1:100
  session.advance('1 ms');
end
disp(py.operator.getitem(session, 'motor_speed'))

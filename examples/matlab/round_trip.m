% A simulation read as a timetable, written as a log, imported again: the same numbers.
% Runs in MATLAB and in GNU Octave, in a folder that may be written.
elevon_command('simulate', 'torino-rotary', '--fidelity', 'low', '--duration', '0.5', '--record', ...
               'motor_speed,output_position,current_q@400 Hz', '--out', 'run.mat', '--force');
[data, units] = elevon_read('run.mat');
if isstruct(data)
  time = data.time;
else
  time = seconds(data.Properties.RowTimes);
end
fprintf('%d samples, output_position in %s\n', numel(time), units.output_position);
if isstruct(data)
  log = struct('time', data.time, 'motor_speed', data.motor_speed, ...
               'output_position', data.output_position, 'torque_current', data.current_q);
else
  log = renamevars(data, 'current_q', 'torque_current');
end
elevon_write('log.mat', log);
map = fullfile(fileparts(mfilename('fullpath')), 'columns.toml');
elevon_command('import', 'log.mat', '--map', map, '--out', 'again.mat', '--force');
again = elevon_read('again.mat');
worst = 0;
for name = {'motor_speed', 'output_position', 'torque_current'}
  worst = max(worst, max(abs(again.(name{1}) - log.(name{1}))));
end
fprintf('greatest difference: %g\n', worst);
